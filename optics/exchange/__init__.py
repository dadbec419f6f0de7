"""Files: results, STEP and its proofs, other programs, parts and assemblies."""
