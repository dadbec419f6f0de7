"""For whom packs are, and how each brings one in: from what is publicly known of the programs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Program:
    """A program that a pack is for.

    name : as its people know it.  rays : suffix of its ray files; "" for a pack without light.
    steps : how to bring a pack in; names in braces are filled in, see `readme`.
    """

    name: str
    rays: str
    steps: tuple[str, ...]

    @property
    def traces(self) -> bool:
        """Whether its people trace light, so that a pack holds rays and the light to expect."""
        return bool(self.rays)


PROGRAMS = {
    "zemax": Program(
        "Ansys Zemax OpticStudio",
        ".dat",
        (
            "Use non-sequential mode. Set the lens units to millimetres before anything is loaded, and the "
            "wavelength to {wavelength}.",
            "Copy lens.step to the folder Objects/CAD Files of your Zemax data folder, and the files "
            "rays_*.dat to Objects/Sources/Source Files.",
            'Insert an object "CAD Part: STEP/IGES/SAT" with lens.step at X = Y = Z = 0 without tilt. '
            'Material: a "Model" glass of index {index} at {wavelength}, without dispersion.',
            'Insert a "Source File" with rays_source.dat at X = Y = Z = 0, with as many analysis rays as the '
            "file holds, and Randomize = 0. Its power is the flux below.",
            'Insert a "Detector Rectangle" where the screen is, with its half-widths and pixels. For the far '
            'field take a "Detector Polar", or angle space of a detector just behind the lens.',
            'Trace with "Use Polarization" for the losses at the faces, without "Split NSC Rays" and without '
            '"Scatter NSC Rays".',
            'sag_front.dat and sag_rear.dat are for "Grid Sag" surfaces of sequential mode. Import them with '
            "bicubic interpolation; the vertex of each is that of its face.",
        ),
    ),
    "lighttools": Program(
        "Synopsys LightTools",
        ".ray",
        (
            "Set the system units to millimetres.",
            "Import lens.step as a solid (File > Import > STEP) at the origin, without rotation. Give it a "
            "user material of index {index} at {wavelength}.",
            "Give the faces the optical property Fresnel loss, without ray splitting by probability.",
            "Insert a ray data source with rays_source.ray at the origin. Its power is the flux below; "
            "switch off any random order, and trace as many rays as the file holds.",
            "Put a dummy plane where the screen is, with a receiver. Give its illuminance mesh the "
            "half-widths and pixels below, without smoothing. For the far field take a far-field receiver.",
            "Run a forward simulation.",
        ),
    ),
    "speos": Program(
        "Ansys Speos",
        ".tm25ray",
        (
            "Open lens.step as a design in millimetres. Keep its axis system as the one of the scene.",
            "Give the body a material: volume property optic with index {index} at {wavelength}, surface "
            "property optical polished.",
            "Insert a ray-file source with rays_source.tm25ray on that axis system, with the flux of the "
            "file.",
            "Insert an irradiance sensor where the screen is, with its half-widths and pixels (sampling). "
            "For the far field take an intensity sensor.",
            "Run a direct simulation with as many rays as the file holds. Look at the map without filtering.",
        ),
    ),
    "shop": Program(
        "the shop that makes the lens",
        "",
        (
            "lens.step is the part, and it is exact: front and rear are splines or conics, not facets.",
            "points_*.xyz are for turning, milling and measuring programs that take points with normals.",
            "sag_*.dat are the same faces as regular tables, from the vertex of each face.",
            "lens.stl is for looking and printing. Do not cut optical faces by it.",
        ),
    ),
}
