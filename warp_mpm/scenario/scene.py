"""A whole scene."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from warp_mpm.scenario.barrier import Barrier
from warp_mpm.scenario.checks import problems
from warp_mpm.scenario.design import Design
from warp_mpm.scenario.flow import Flow, offer_laws
from warp_mpm.scenario.settings import Domain, Gravity, Ground, Numerics, Output, offer_schemes
from warp_mpm.scenario_errors import ScenarioError, read_json
from warp_mpm.schema import Model, Text, set_fields


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
        return cls.model_validate(_beside(read_json(Path(path)), Path(path).parent), source_name=str(path))

    @model_validator(mode="before")
    @classmethod
    def _without_schema_pointer(cls, data: Any) -> Any:
        # "$schema" tells an editor where the JSON Schema lies; it says nothing about the scene.
        return {key: value for key, value in data.items() if key != "$schema"} if isinstance(data, dict) else data

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
        found = problems(self)
        if found:
            raise ValueError("\n".join(found))
        return self


def _beside(data: Any, folder: Path) -> Any:
    """The content of a scenario file, with the files that it names looked for beside it."""
    flow = data.get("flow") if isinstance(data, dict) else None
    inflow = flow.get("inflow") if isinstance(flow, dict) else None
    if not isinstance(flow, dict) or not isinstance(inflow, dict):
        return data
    if not isinstance(inflow.get("hydrograph_csv"), str):
        return data
    found = inflow | {"hydrograph_csv": str(folder / inflow["hydrograph_csv"])}
    return data | {"flow": flow | {"inflow": found}}


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
