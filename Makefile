# make demo   sets everything up and designs the lens of examples/pearl.toml
# make test   sets everything up and runs the tests, on all cores
# make quick  a fast part of the tests, of every room
# make slow   the tests that `make test` leaves out: whole programs, statistical repetitions, most cases of
#             costly claims; and the property tests once more, with more examples
# make all    every test once: as `make test` and `make slow` together, without the properties twice
# make coverage  runs the tests and prints what they cover
# make lint   ruff and mypy, also for Windows and macOS
# make docs   sets everything up and builds the documentation site into build/site; it needs no network
# make dist   sets everything up, builds sdist and wheel into dist, and checks their metadata
# make licences  sets everything up and prints the licence of every package in .venv; fails at one that does not suit
# make environments  tests thbcad beside each CAD tool and OCP, from 7.8 to 8.0, in environments of their own
# make gallery  designs all examples, an hour or so, and writes docs/gallery.md with its pictures
# Another interpreter: make PYTHON=/path/to/python3.12 demo

PYTHON ?=
export PYTHON
# Compiled modules are kept: to compile the tests, and the packages for each program that they start, takes a
# fifth of the time of the tests.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick slow all coverage lint docs dist licences environments gallery setup clean

demo:
	@echo "This sets up Python packages in .venv, then shapes a lens that casts 'Girl with a Pearl Earring' and writes it to exports/pearl/."
	@$(MAKE) --no-print-directory setup
	@.venv/bin/thbcad design examples/pearl.toml --out exports/pearl
	@echo "Done. Look at exports/pearl/report.html (pictures and checks) and exports/pearl/lens.step (the solid)."

# Tests run side by side on all cores, each on one thread (tests/conftest.py).  The tests of a file stay
# together, since they share costly fixtures (`loadgroup` does not: pytest-xdist 3.8 finds no group of a test
# under pytest 9.2).  What several files share lies in one folder (tests/cases.py).
PYTEST = .venv/bin/python -m pytest -n logical --dist loadfile --no-loadscope-reorder

test: setup
	@$(PYTEST) -m "not slow"

slow: setup
	@HYPOTHESIS_PROFILE=thorough $(PYTEST) -m "slow or hypothesis"

all: setup
	@HYPOTHESIS_PROFILE=thorough $(PYTEST)

coverage: setup
	@$(PYTEST) -m "not slow" --cov --cov-report=term

# Quick files of tests: at least one for each room, those that need no whole design.
# tests/test_architecture.py compares the rooms.
QUICK = \
	tests/test_architecture.py \
	tests/test_doors.py \
	tests/test_loading.py \
	tests/test_bench_error.py \
	tests/test_docs_site.py \
	tests/optics/base/statistics \
	tests/optics/light/analysis/test_judgement.py \
	tests/optics/light/blur \
	tests/optics/interface/api/test_minimisation.py \
	tests/optics/interface/api/test_model.py \
	tests/optics/tolerancing/metrology/test_measured_points.py \
	tests/optics/scene/limits/test_limits.py \
	tests/optics/interface/commands/test_new.py \
	tests/optics/light/engines \
	tests/optics/designing/etendue/test_kernel.py \
	tests/optics/exchange/export/test_formats.py \
	tests/optics/exchange/cross_checks/test_file_tracers.py \
	tests/optics/reporting/figures/test_lens_and_light.py \
	tests/optics/tolerancing/form_errors/test_period_bands.py \
	tests/optics/tolerancing/perturbations/test_height_errors.py \
	tests/optics/tolerancing/perturbations/test_perturbed_light.py \
	tests/optics/scene/luminaires \
	tests/optics/tolerancing/monte_carlo_samples/test_sampling.py \
	tests/optics/interface/api/test_monte_carlo.py \
	tests/optics/scene/keys \
	tests/optics/scene/materials \
	tests/optics/exchange/mitsuba/test_mesh.py \
	tests/optics/designing/optimisation/test_bounded_variables.py \
	tests/optics/designing/starts/test_rear_light.py \
	tests/optics/designing/optimisation/test_loop_failures.py \
	tests/optics/designing/optimisation/test_refinement.py \
	tests/optics/base/optimisers \
	tests/optics/light/outgoing/test_rays_of_lens.py \
	tests/optics/exchange/assemblies/test_proof.py \
	tests/optics/scene/photometry \
	tests/optics/designing/prediction/test_automatic.py \
	tests/optics/scene/problem/test_schema.py \
	tests/optics/scene/problem/test_toml_text.py \
	tests/optics/designing/progress \
	tests/optics/scene/ray_files \
	tests/optics/interface/relighting \
	tests/optics/interface/screens \
	tests/optics/reporting/live/test_live.py \
	tests/optics/reporting/report/test_html.py \
	tests/optics/exchange/results \
	tests/optics/exchange/packs/test_dense_points.py \
	tests/optics/scene/receivers \
	tests/optics/base/runtime \
	tests/benchmarks/test_quoted_numbers.py \
	tests/optics/designing/penalties \
	tests/optics/scene/sources \
	tests/optics/interface/sweeps/test_store.py \
	tests/optics/interface/audit/test_audit_table.py \
	tests/optics/scene/system/test_lenses_of_elements.py \
	tests/optics/light/measuring/test_splat.py \
	tests/optics/light/refraction \
	tests/optics/light/roads \
	tests/optics/tolerancing/machining \
	tests/optics/scene/paths/test_light_path.py \
	tests/optics/light/tracing/test_sequential.py \
	tests/optics/light/intersections/test_span_search.py \
	tests/optics/designing/transport \
	tests/optics/exchange/verification/test_step_checks.py \
	tests/optics/reporting/view \
	tests/optics/base/workers/test_task_loop.py \
	tests/thesis/test_gradients.py \
	tests/thesis/chapter7/test_analytic.py \
	tests/thesis/chapter7/test_deconvolution.py \
	tests/thbcad/test_poses.py \
	tests/thbcad/test_refusals.py \
	tests/thbcad/cad/exchange/test_ray_faces.py \
	tests/thbcad/cad/parts/test_search.py \
	tests/thbcad/cad/foreign \
	tests/thbcad/cad/shapes/test_aperture_solid.py \
	tests/thbcad/certified/test_extreme_values.py \
	tests/thbcad/drawings/test_views.py \
	tests/thbcad/fitting/test_adaptive_fit.py \
	tests/thbcad/hierarchy/test_levels.py \
	tests/thbcad/hierarchy/test_reference_values.py \
	tests/thbcad/hierarchy/test_thb_space.py \
	tests/thbcad/io/test_spline_json.py \
	tests/thbcad/lens/test_lens.py \
	tests/thbcad/lens/test_product.py \
	tests/thbcad/meshes \
	tests/thbcad/moulds \
	tests/thbcad/mounts \
	tests/thbcad/outlines \
	tests/thbcad/test_pictures.py \
	tests/thbcad/sags/test_conic.py \
	tests/thbcad/splines/test_knot_vector.py \
	tests/thbcad/splines/test_nurbs.py \
	tests/thbcad/surfaces/test_priced_faces.py \
	tests/thbcad/test_toml.py \
	tests/thbcad/tools/test_cusps.py

quick: setup
	@$(PYTEST) -m "not slow" $(QUICK)

lint: setup
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@scripts/types

# A warning (a link, an anchor or a name that leads nowhere) ends the build: --quiet would not see it.
docs:
	@scripts/setup docs
	@NO_MKDOCS_2_WARNING=true .venv/bin/python -m mkdocs build
	@echo "Done. Open build/site/index.html."

# twine has an environment of its own, since it brings much else.
dist: setup
	@rm -rf dist build/twine
	@.venv/bin/python -m build
	@.venv/bin/python -m venv build/twine
	@build/twine/bin/pip install -q --disable-pip-version-check -c constraints.txt twine
	@build/twine/bin/twine check --strict dist/*

licences: setup
	@.venv/bin/python scripts/licences.py

environments: setup
	@.venv/bin/python scripts/environments.py

# Store the rows only on a quiet machine: they are the times of the page.
gallery: setup
	@.venv/bin/thbcad bench gallery --store
	@.venv/bin/thbcad bench --markdown

setup:
	@scripts/setup

clean:
	rm -rf .venv build dist *.egg-info
