def how_copied(data): return None
def as_it_was(*a): return None
