def recover_sqlite(*a): raise NotImplementedError
