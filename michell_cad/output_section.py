"""The `[output]` table of a job: which files to write."""

from pydantic import BaseModel, Field, field_validator

from michell_cad.cad.formats import ExportOptions, FormatName
from michell_cad.cad.step import StepForm, StepSchema
from michell_cad.job_values import STRICT, Switch


class OutputSection(BaseModel):
    """Which files to write; truss.json, design.npz and report.json are always written."""

    model_config = STRICT
    formats: tuple[FormatName, ...] = Field(
        default=("step", "stl"),
        description="Files of the solid; 3mf-beams has the members as a lattice of beams, glb is for viewing.",
    )
    step_form: StepForm | None = Field(
        default=None,
        description="solid: one; assembly: one per curve and per node. Default: solid, for other profiles than round "
        "ones the assembly, which is all that they have.",
    )
    step_schema: StepSchema = Field(default="AP214", description="Schema of the STEP file.")
    pcurves: Switch = Field(default=False, description="Write STEP with the edges in the parameters of their faces.")
    brep_binary: Switch = Field(default=False, description="Write BREP in binary, not as text.")
    preview: Switch = Field(default=True, description="Write preview.png.")

    @field_validator("formats")
    @classmethod
    def _each_once(cls, value: tuple[FormatName, ...]) -> tuple[FormatName, ...]:
        if len(set(value)) == len(value):
            return value
        raise ValueError(f"expected every format at most once, found {', '.join(value)}")

    @property
    def options(self) -> ExportOptions:
        """What the formats leave to choose."""
        return ExportOptions(self.step_form, self.step_schema, self.pcurves, self.brep_binary)
