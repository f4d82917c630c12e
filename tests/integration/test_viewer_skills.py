"""The live view of other skills than throws at baskets: taught, learned and executed from the
page, with their own bodies.
"""

import re

import numpy as np
import pytest

from dart_skill.skills.protocol import load_skill
from tests.integration.conftest import graphs, wait_for
from tests.view_client import PageClient


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "button", "shown"), [("darts", "Throw", 3), ("place", "Execute", 3)]
)
def test_a_skill_is_taught_learned_and_executed_from_the_page(ros, tmp_path, name, button, shown):
    skill = load_skill(name)
    with graphs(tmp_path) as make:
        graph, client = make("composed", 0, skill=name)
        graph.start("viewer", {"port": 0, "skill": name})
        log = graph.logs / "viewer.log"
        wait_for(
            client, lambda: "live view is at" in log.read_text(), what="the address of the page"
        )
        url = re.search(r"http://\S+", log.read_text()).group()
        with PageClient(url, origin=url) as page:

            def until(condition, what, limit=60.0):
                page.wait_for(condition, limit, what, meanwhile=client.spin)

            until(
                lambda: page.says(skill.words.welcome) and page.says(f"Learn, then {button}"),
                "what to press",
            )
            until(lambda: all(f"/{role}" in page.places for role in skill.bodies), "the bodies")
            page.set("Lessons", shown)
            page.click("Teach")
            until(
                lambda: page.says(f"{shown} of {shown} demonstrations shown"),
                "demonstrations",
                180.0,
            )
            page.click("Learn")
            until(lambda: page.says(f"from {shown} demonstrations"), "a model")
            until(lambda: "/gaussians/components" in page.nodes, "the Gaussians")
            page.click(button)
            until(lambda: page.says(f"mm {skill.words.off}"), "what came of it", 120.0)
            until(lambda: not page.is_disabled("Teach"), "its end")
            assert np.isfinite(page.places[f"/{skill.bodies[0]}"]).all()
            assert "/basket" not in page.places and "/ball" not in page.places
