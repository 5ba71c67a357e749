"""voxelpose body list, show, choose and make."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from calib.errors import InputError
from calib.storage.atomic import write_whole
from voxelpose.cli import arguments

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel

_NAMES = {
    "stature_m": "stature",
    "chest_girth_m": "chest",
    "waist_girth_m": "waist",
    "hip_girth_m": "hip",
    "arm_length_m": "arm",
    "leg_length_m": "leg",
    "shoulder_breadth_m": "shoulders",
    "mass_kg": "mass",
}
_ALL = "all"


@dataclass(frozen=True)
class ListBodies:
    """Lists the bodies that have names.

    They are the 24 of Okada and Stenger: ten men after JIS L 4004 and fourteen women after JIS L
    4005. Numbers in brackets are computed by us; those with * are from sellers' tables of the
    standard, the rest follows from the name by the standard's scheme. Nothing could be compared
    with the standard.

      voxelpose body list
    """

    def run(self) -> None:
        """Prints the list."""
        from silhouette_core.body.presets import SOURCES, body_presets

        marks = {SOURCES["d"]: "{:.2f}  ", SOURCES["t"]: "{:.2f}* ", SOURCES["c"]: "({:.3f})"}
        print("name    sex     standard    stature  chest   waist    hip      (metres)")
        for preset in body_presets():
            cells = [
                f"{marks[preset.sources[name]].format(value):8}"
                for name, value in preset.measurements.known().items()
            ]
            print(f"{preset.name:7} {preset.sex:7} {preset.standard}  {' '.join(cells)}".rstrip())


@dataclass(frozen=True)
class ShowBody:
    """Measures a body, and draws it.

    BODY is a name of `voxelpose body list`, a body.toml, or an earlier result; `all` stands for all
    the bodies that have names. The measurements are taken on the body's surface, as a tape would.

      voxelpose body show 92A5 --png man.png
      voxelpose body show me.toml
      voxelpose body show all --png bodies.png
    """

    body: Annotated[Positional[str], arg(metavar="BODY")]
    """Name of a body, body.toml, earlier result, or all."""
    png: arguments.OptionalFile = None
    """Picture to be written: from three sides and bent; of all: each from the front."""
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Prints the measurements."""
        arguments.refuse_existing([self.png], self.overwrite, "--png")
        if self.body.lower() == _ALL:
            self._show_all()
            return
        from silhouette_core.body.presets import body_preset
        from silhouette_core.motion.body_source import load_body

        body = load_body(self.body)
        preset = body_preset(self.body)
        _print_measurements(body)
        if preset is not None:
            name, sources = f"{preset.standard} {preset.name}", preset.sources.items()
            listed = ", ".join(f"{_NAMES[measure]} {source}" for measure, source in sources)
            print(f"{name}: {listed}; not compared with the standard itself")
        if self.png is not None:
            from voxelpose.view.images.canvas import png
            from voxelpose.view.images.hull_picture import body_picture

            write_whole(self.png, png(body_picture(body)))
            print(f"picture: {self.png}")

    def _show_all(self) -> None:
        from silhouette_core.body.presets import body_presets

        if self.png is None:
            raise InputError("body show all draws a picture: add --png FILE, or name one body")
        from voxelpose.view.images.canvas import png
        from voxelpose.view.images.hull_picture import bodies_picture

        presets = body_presets()
        captions = []
        for preset in presets:
            stature, *girths = preset.measurements.known().values()
            sizes = " / ".join(f"{100 * girth:.0f}" for girth in girths)
            captions.append(f"{preset.name}  {stature:.2f} m\n{sizes}")
        write_whole(self.png, png(bodies_picture([preset.body() for preset in presets], captions)))
        print(f"picture: {self.png}")


@dataclass(frozen=True, kw_only=True)
class ChooseBody:
    """Chooses the named body that is closest to a person.

    As in Okada and Stenger, by stature and chest girth.

      voxelpose body choose --stature 1.72 --chest 0.95 --sex male
    """

    stature: Annotated[float, arg(metavar="M")]
    """Height in metres."""
    chest: arguments.OptionalLength = None
    """Chest or bust girth in metres. Default: only the stature counts."""
    sex: arguments.Sex = "unknown"

    def run(self) -> None:
        """Prints the name."""
        from silhouette_core.body.presets import nearest_preset

        preset = nearest_preset(self.stature, self.chest, self.sex)
        known = preset.measurements.known()
        sizes = ", ".join(f"{_NAMES[name]} {value:.2f} m" for name, value in known.items())
        print(f"{preset.name} ({preset.sex}, {preset.standard}: {sizes})")


@dataclass(frozen=True, kw_only=True)
class MakeBody:
    """Makes a body from measurements.

    The measurements taken on the body's surface are those given, to half a percent; what is not
    given follows from the rest. The file is taken by --body of fit, track, demo and library build.

      voxelpose body make --stature 1.80 --chest 1.02 --waist 0.90 --sex male --out me.toml
    """

    stature: Annotated[float, arg(metavar="M")]
    """Height in metres, without shoes."""
    out: Annotated[Path, arg(metavar="FILE.toml")]
    """File to be made."""
    sex: arguments.Sex = "unknown"
    chest: arguments.OptionalLength = None
    """Chest or bust girth at the nipples, metres."""
    waist: arguments.OptionalLength = None
    """Girth of the natural waist, metres."""
    hip: arguments.OptionalLength = None
    """Largest girth over the buttocks, metres."""
    arm: arguments.OptionalLength = None
    """From the tip of the shoulder over the elbow to the wrist, metres."""
    leg: arguments.OptionalLength = None
    """Inside leg, from the crotch to the sole, metres."""
    shoulders: arguments.OptionalLength = None
    """Breadth between the tips of the shoulders, metres."""
    mass: Annotated[float | None, arguments.optional("KG")] = None
    """Mass in kilograms."""
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Writes the body."""
        if self.out.suffix.lower() != ".toml":
            raise InputError(f"--out {self.out} is no body file: give a name that ends in .toml")
        arguments.refuse_existing([self.out], self.overwrite)
        from silhouette_core.body.body_file import write_body
        from silhouette_core.body.measured_body import body_from_measurements
        from silhouette_core.body.mesh_measurements import BodyMeasurements

        wanted = BodyMeasurements(**{field: getattr(self, name) for field, name in _NAMES.items()})
        body = body_from_measurements(wanted, self.sex)
        given = ", ".join(f"{_NAMES[name]} {value:g}" for name, value in wanted.known().items())
        write_body(body, self.out, f"made by voxelpose body make from {given}")
        _print_measurements(body)
        print(f"body: {self.out}")


def _print_measurements(body: BodyModel) -> None:
    from silhouette_core.body.mesh_measurements import measure_body

    print(f"sex {body.sizes.sex}, {len(body.vertices_m)} vertices, {len(body.faces)} triangles")
    for name, value in measure_body(body).known().items():
        digits, unit = (1, "kg") if name == "mass_kg" else (3, "m")
        print(f"{_NAMES[name]:10} {value:7.{digits}f} {unit}")


SUBCOMMANDS = {"list": ListBodies, "show": ShowBody, "choose": ChooseBody, "make": MakeBody}
