"""Graphs of the networks that mvpose fetches: ``python -m tools.networks PACKAGE.tgz``.

    graph of TensorFlow.js -> part between pictures and heads -> ONNX without weights, in mvpose/networks/data

``graphs.toml`` names the parts. ``python -m tools.networks.tfjs_oracle`` compares the networks with TensorFlow.
"""
