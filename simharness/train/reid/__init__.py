"""The person re-identification network: ``python -m simharness.train.reid``.

    identities, poses, stages -> crops (rendered) -> training (PyTorch) -> ONNX -> evaluation (onnxruntime) -> card

Only ``network`` and ``training`` need PyTorch.
"""
