"""Shape a lens by a network of drjit.nn: it gives the change of the transport start at every position.

c = c0 + 0.1 mm * network(x, y, r),    r^2 = x^2 + y^2,    at the Greville points, from -1 to 1
"""

import numpy as np
from drjit_adam import PROBLEM, Adam, Float, Irradiance, dr

import optics

nn, Tensor = dr.nn, dr.llvm.ad.TensorXf64
WIDTH, REACH = 64, 0.1  # neurons of a layer; mm


def main(steps: int = 200) -> dict[str, float]:
    system = optics.System(optics.load_problem(PROBLEM))
    space = system.space(level=2)
    model = system.model(space, rays=(257, 257), window="cells")
    target, start = Float(model.target.ravel()), Float(system.transport_start(space).coefficients)
    greville = space.kv_u.bisect().bisect().greville() / space.kv_u.stop  # of level 2
    x, y = greville[space.functions[:, 1:].T]
    position = Tensor(np.array([x, y, np.hypot(x, y)]))
    layers = nn.Linear(-1, WIDTH), nn.Tanh(), nn.Linear(-1, WIDTH), nn.Tanh(), nn.Linear(-1, 1)
    network = nn.Sequential(nn.SinEncode(4), *layers).alloc(Tensor, 3)
    network["layers.5.weights"] *= 0.0  # the first lens is the transport start
    adam = Adam(lr=0.005, params=network)
    for _ in range(steps):
        network.update(adam)
        irradiance = dr.custom(Irradiance, model, start + REACH * network(position).array)
        dr.backward(dr.sum(dr.square(irradiance - target)) / dr.sum(dr.square(target)))
        adam.step()
    network.update(adam)
    return system.measure(system.lens(space, (start + REACH * network(position).array).numpy())).metrics


if __name__ == "__main__":
    print(f"rel_l2 {main()['rel_l2']:.4f}")
