"""What evidence rests on: keys of runs and scenes."""

from __future__ import annotations

import pytest

from warp_mpm.accuracy import keys, shipped
from warp_mpm.accuracy.keys import MEASUREMENT, code_text, imported_by, run_key, scenario_fields, scene_key
from warp_mpm.scenario import Scenario


class TestKeys:
    def test_optional_field_that_is_new_leaves_keys_as_they_were(self, scene: Scenario) -> None:
        class NumericsWithMore(type(scene.numerics)):  # type: ignore[misc]
            more: float = 0.0

        settings = scene.numerics.model_dump()
        plain = scene.model_copy(update={"numerics": NumericsWithMore(**settings)})
        turned = scene.model_copy(update={"numerics": NumericsWithMore(**settings, more=1.0)})
        assert run_key(plain) == run_key(scene)
        assert run_key(turned) != run_key(scene)

    def test_numbers_of_another_program_are_others(self, scene: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
        own, place = run_key(scene), scene_key(scene)
        monkeypatch.setattr(keys, "program_digest", lambda: "other")
        assert run_key(scene) != own
        assert scene_key(scene) == place

    def test_default_that_changes_changes_the_key(self, scene: Scenario) -> None:
        class OtherDefault(type(scene.numerics)):  # type: ignore[misc]
            courant_number: float = 0.4

        assert "numerics.courant_number" in scenario_fields(scene)
        given = {name: value for name, value in scene.numerics.model_dump().items() if name != "courant_number"}
        other = scene.model_copy(update={"numerics": OtherDefault(**given)})
        assert run_key(other) != run_key(scene)

    def test_measurement_rests_on_what_it_imports(self) -> None:
        found = imported_by(MEASUREMENT)
        assert {"warp_mpm.summary", "analytic.force_record", "warp_mpm.simulation", "warp_mpm.scenario.flow"} <= found
        assert {"warp_mpm.kernels.transfer", "warp_mpm.mechanism"} <= found
        assert not {"warp_mpm.report", "warp_mpm.cli", "analytic.plots"} & found

    def test_words_of_the_code_do_not_count_and_rules_do(self) -> None:
        rule = 'def peak(force):\n    """The greatest."""\n    return max(force)  # of all\n'
        reworded = 'def peak(force):\n    """Greatest of them."""\n    return max(force)\n'
        assert code_text(rule, schema=False) == code_text(reworded, schema=False)
        assert code_text(rule, schema=False) != code_text(rule.replace("max", "min"), schema=False)

    def test_declarations_of_the_schema_do_not_count_and_its_checks_do(self) -> None:
        group = "class Group(Model):\n    a: float = 1.0\n\n    def twice(self):\n        return 2 * self.a\n"
        more = group.replace("a: float = 1.0\n", "a: float = 1.0\n    b: float = 0.0\n")
        assert code_text(group, schema=True) == code_text(more, schema=True)
        assert code_text(group, schema=False) != code_text(more, schema=False)
        assert code_text(group, schema=True) != code_text(group.replace("2 *", "3 *"), schema=True)

    def test_ladder_whose_figures_were_made_by_other_rules_is_not_used(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert shipped.shipped_scenes(), (
            "The rules that make figures have changed, or what is shipped lacks what the settings do; take it anew by "
            "the command of `make accuracy` that has --data"
        )
        monkeypatch.setattr(shipped, "rules_digest", lambda: "other")
        assert not shipped.shipped_scenes()
