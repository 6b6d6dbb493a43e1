"""Public networks by name: what they are and where from, their conversion to ONNX, and the folder of the user's own."""
