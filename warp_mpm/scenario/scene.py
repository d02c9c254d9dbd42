"""A whole scene."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from warp_mpm.scenario.barrier import Barrier, FurtherBarrier
from warp_mpm.scenario.checks import problems
from warp_mpm.scenario.design import Design
from warp_mpm.scenario.flow import Flow, offer_laws
from warp_mpm.scenario.ground import Ground
from warp_mpm.scenario.settings import Domain, Gravity, Numerics, Output, offer_schemes
from warp_mpm.scenario_errors import ScenarioError, read_json
from warp_mpm.schema import Model, Text, set_fields
from warp_mpm.tables_beside import with_tables_beside


class Scenario(Model):
    """A whole scene. `Scenario.load(path)` reads one; `Scenario.model_validate(dict)` makes one from Python.

    They and the constructor raise one error, ScenarioError.
    """

    title: Annotated[Text, Field(min_length=1, max_length=200)]
    """One line that names the scene."""
    source: Text = ""
    """Where the scene's figures come from."""
    notes: Annotated[tuple[Text, ...], Field(strict=False)] = ()
    """Remarks, for instance on a figure of the source that had to be interpreted."""
    gravity: Gravity = Gravity()
    flow: Annotated[Flow, Field(discriminator="formulation")]
    barrier: Barrier | None = None
    """null: no barrier."""
    barriers: Annotated[tuple[FurtherBarrier, ...], Field(strict=False, max_length=20)] = ()
    """Further barriers, each with a name; they neither need `barrier` nor stand in for it."""
    ground: Ground | None = Ground()
    """null: no ground, for instance for a free jet."""
    domain: Domain = Domain()
    numerics: Numerics = Numerics()
    output: Output
    design: Design | None = None
    """Limits and partial factors; null: no verdict."""

    @classmethod
    def load(cls, path: str | Path) -> Scenario:
        """Read a scenario from a JSON file.

        Raises:
            ScenarioError: the file cannot be read, is no JSON, or says something impossible; one sentence per problem.
        """
        content = read_json(Path(path))
        if isinstance(content, dict) and "vary" in content and "flow" not in content:
            raise ScenarioError(["This is a sweep; python -m warp_mpm sweep runs it."], str(path))
        return cls.model_validate(with_tables_beside(content, Path(path).parent), source_name=str(path))

    @model_validator(mode="before")
    @classmethod
    def _without_schema_pointer(cls, data: Any) -> Any:
        # "$schema" tells an editor where the JSON Schema lies; it says nothing about the scene.
        return {key: value for key, value in data.items() if key != "$schema"} if isinstance(data, dict) else data

    @property
    def all_barriers(self) -> list[tuple[str, float, Barrier]]:
        """Name, x of the toe [m] and barrier of each one, from upstream to downstream."""
        found: list[tuple[str, float, Barrier]] = [("barrier", 0.0, self.barrier)] if self.barrier is not None else []
        found += [(one.name, one.x_m, one) for one in self.barriers]
        return sorted(found, key=lambda one: one[1])

    def of_material(self, place: int) -> Scenario:
        """The scene as if all of it were of one of its materials (`flow.materials`), which nothing but the kernels'
        numbers of that material are taken from."""
        return self.model_copy(update={"flow": self.flow.of_material(place)})

    @property
    def plain(self) -> bool:
        """Whether the ground is level or absent, and there is no barrier but a single trapezoid or wall."""
        level = self.ground is None or self.ground.level
        shaped = self.barrier is not None and self.barrier.shape.kind == "outline"
        return level and not self.barriers and not shaped

    def resolved(self) -> dict[str, Any]:
        """The scenario as a dict of plain JSON values with every default filled in; loads to an equal Scenario."""
        return self.model_dump(mode="json")

    def replaced(self, changes: Mapping[str, Any]) -> Scenario:
        """A copy with some fields changed, named by their path: `{"numerics.spacing_m": 0.25}`.

        Raises:
            ScenarioError: a changed value is not allowed, or the path leads nowhere.
        """
        data = self.resolved()
        for path, value in changes.items():
            *parents, leaf = path.split(".")
            place = data
            for name in parents:
                if not isinstance(place.get(name), dict):
                    raise ScenarioError([f"{path} leads nowhere: this scenario has no group {name!r} there."])
                place = place[name]
            place[leaf] = value
        return type(self).model_validate(data)

    @model_validator(mode="after")
    def _scene(self) -> Self:
        object.__setattr__(self, "flow", self.flow.laid_on(self.ground if self.ground is not None else Ground()))
        found = problems(self)
        if found:
            raise ValueError("\n".join(found))
        return self


def offer_anew() -> None:
    """Make scenarios take the laws and transfer schemes that there are now."""
    offer_laws()
    offer_schemes()
    set_fields(Scenario, {"numerics": (Numerics, Numerics())})


def json_schema() -> str:
    """The scenario format as JSON Schema (draft 2020-12), indented text."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}
    schema["properties"] = {"$schema": {"type": "string"}, **schema["properties"]}
    return json.dumps(schema, indent=2, ensure_ascii=False)
