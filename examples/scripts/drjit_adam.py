"""Shape a lens by Dr.Jit's Adam: the model is one operation of Dr.Jit's automatic differentiation."""

from pathlib import Path

import optics
from optics.base.runtime import load_backend

BACKEND = load_backend()  # Dr.Jit, with an LLVM that works
dr, Float = BACKEND.dr, BACKEND.Float
from drjit.opt import Adam  # noqa: E402

PROBLEM = Path(__file__).parents[1] / "tophat_circle.toml"


class Irradiance(dr.CustomOp):
    """The light of a model: coefficients (dim,) -> irradiance (rows * columns,)."""

    def eval(self, model: optics.Model, c: Float) -> Float:
        self.image, self.pull = model.vjp(c.numpy())
        return Float(self.image.ravel())

    def backward(self) -> None:
        self.set_grad_in("c", Float(self.pull(self.grad_out().numpy().reshape(self.image.shape))))


def main(steps: int = 80) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    space = system.space(level=2)
    model = system.model(space, rays=(257, 257), window="cells")
    target = Float(model.target.ravel())
    adam = Adam(lr=0.005, params={"c": Float(system.transport_start(space).coefficients)})  # lr: mm
    for _ in range(steps):
        irradiance = dr.custom(Irradiance, model, adam["c"])
        dr.backward(dr.sum(dr.square(irradiance - target)) / dr.sum(dr.square(target)))
        adam.step()
    return system.measure(system.lens(space, adam["c"].numpy())).metrics


if __name__ == "__main__":
    print(f"rel_l2 {main()['rel_l2']:.4f}")
