"""Training of the person re-identification network: ``python -m tools.reid``.

    identities, poses, moments -> crops (rendered) -> training (PyTorch) -> ONNX -> evaluation (onnxruntime) -> card

Only ``network`` and ``training`` need PyTorch.
"""
