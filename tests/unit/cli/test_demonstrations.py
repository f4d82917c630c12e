"""A demonstration is named by its number in the list, or by its id."""

from types import SimpleNamespace

import pytest

verb = pytest.importorskip("dart_skill_nodes.verbs.demonstrations")


class Listing:
    """A client of a graph that was shown some demonstrations."""

    def __init__(self, *ids):
        self.shown = [SimpleNamespace(id=one) for one in ids]

    def demonstrations(self):
        return SimpleNamespace(demonstrations=self.shown)


def test_a_number_is_that_of_the_list_and_an_id_is_itself():
    client = Listing("demonstration_7", "demonstration_9")
    assert verb.id_of(client, "2") == "demonstration_9"
    assert verb.id_of(client, "demonstration_7") == "demonstration_7"


@pytest.mark.parametrize(
    ("ids", "said"), [(("a", "b"), "the list has numbers 1 to 2"), ((), "nothing in it yet")]
)
def test_a_number_that_the_list_does_not_have_is_refused(ids, said):
    for given in ("0", "3"):
        with pytest.raises(ValueError, match=f"no demonstration {given}: .*{said}"):
            verb.id_of(Listing(*ids), given)


def test_who_drops_by_number_hears_number_and_id(monkeypatch):
    class Dropping(Listing):
        def drop(self, name, restore):
            return f"{name} is {'back' if restore else 'dropped'}"

    told = []
    monkeypatch.setattr(
        verb,
        "on_running_graph",
        lambda options, ready, task: told.append(task(Dropping("a7", "b8"))["text"]),
    )
    for given in ("2", "b8"):
        options = SimpleNamespace(id=given, task="drop", compare=False)
        verb.main(options, None)
    assert told == ["2 (b8) is dropped", "b8 is dropped"]
