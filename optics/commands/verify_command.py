"""`thbcad verify`: the STEP file of a result folder against its lens, or a STEP file by itself."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from optics.commands.outcome import Outcome
from optics.problem import limit_checks
from optics.results import ResultFolder
from optics.runtime import UserError, check_lines, note
from optics.system import OpticalSystem
from thbcad.doors import pip_command


def verify(options: Namespace) -> Outcome:
    """Check the STEP file of a result folder against its lens, or a STEP file by itself."""
    from optics.runtime import verification
    from optics.verification import (
        StepFile,
        bare_checks,
        fresh_export_checks,
        optiland_available,
        optiland_checks,
        prescription_checks,
        text_and_occt_checks,
        verify as run,
    )
    from thbcad.lens import manufacturability

    path = Path(options.result)
    notes: list[str] = []
    left_out: list[str] = []
    try:
        if path.suffix.lower() in (".step", ".stp"):
            checks, left_out = bare_checks(StepFile(path))
        else:
            from optics.runtime import load_backend

            folder = ResultFolder(path)
            result = folder.read()
            problem, lens = result.problem, result.lens
            system = OpticalSystem(problem)
            if not result.record["ok"]:
                note(f"of the design itself: {result.record['verdict']}")
            backend = load_backend("double", problem.run.threads)
            file = StepFile(folder.step)
            # first the reader that damaged files cannot crash
            checks, notes = fresh_export_checks(system, lens, file)
            checks += prescription_checks(problem, lens)
            checks += text_and_occt_checks(system, lens, file, backend)
            checks += run(system, lens, file, backend)
            checks += limit_checks(problem, manufacturability(lens, problem.lens.density or None))
            if options.optiland and optiland_available():
                checks += optiland_checks(system, lens, file, backend)
            elif options.optiland:
                note(f"optiland is not installed and does not trace the file; {pip_command('verify')}")
    except OSError as error:
        raise UserError(f"cannot read {error.filename or path}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(str(error)) from None
    checked = verification(checks) | {"notes": notes, "left_out": left_out}
    return Outcome(checked, check_lines(checked), checked["ok"])
