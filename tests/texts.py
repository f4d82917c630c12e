"""A small bag for tests of playing: numbered texts, one each hundredth of a second on every topic."""

from dart_skill.recording import BagWriter, definition, serialize, type_hash, types_for

TEXT = "std_msgs/msg/String"


def write_texts(path, topics=("/said",), n=100):
    """The path of a bag with n texts "0", "1", ... on each topic."""
    types = types_for(TEXT)
    with BagWriter(path) as bag:
        for topic in topics:
            bag.add_topic(topic, TEXT, definition(types, TEXT), type_hash=type_hash(types, TEXT))
        for k in range(n):
            for topic in topics:
                bag.write(
                    topic, 10_000_000 * k, 10_000_000 * k, serialize(types, TEXT, {"data": str(k)})
                )
    return path
