"""The echo models that `--fidelity` names, one module each."""
