"""The person re-identification network: ``python -m tools.reid``.

    identities, poses, stages -> crops (rendered) -> training (PyTorch) -> ONNX -> evaluation (onnxruntime) -> card

Only ``network`` and ``training`` need PyTorch.
"""
