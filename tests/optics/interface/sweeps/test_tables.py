"""The table of a sweep: a line for every row, with all its columns."""

from pathlib import Path

from optics.interface.sweeps.sweep_rows import Sweep, SweepRow


class Counted(dict):
    """Metrics that count how often their names are listed."""

    listed = 0

    def __iter__(self):
        self.listed += 1
        return super().__iter__()


def test_names_of_metrics_are_collected_once_however_many_rows_there_are():
    metrics = [Counted(rel_l2=0.1 * k) for k in range(20)]
    found = Sweep(Path("out"), ("x",), [SweepRow((k,), "done", metrics=m) for k, m in enumerate(metrics)])
    assert [line["rel_l2"] for line in found.table()] == [0.1 * k for k in range(20)]
    assert {m.listed for m in metrics} == {1}


def test_a_row_without_a_metric_has_none_in_its_column():
    rows = [SweepRow((1,), "done", metrics={"dof": 9}), SweepRow((2,), "failed", "why")]
    assert [line["dof"] for line in Sweep(Path("out"), ("x",), rows).table()] == [9, None]
