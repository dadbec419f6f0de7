"""How a lens is found: bounds, transport, penalties, optimisation, prediction."""
