"""Pictures of simulated people to scores: the whole way of a recording, with networks that need no training.

No network is shipped, and a public one cannot be had everywhere. So the pictures here show each body in flat colours,
one for each person and body segment, as a network that segments bodies would answer, and the ONNX files find people and
joints in these colours by arithmetic (:mod:`.networks`). Everything else is what users run: an export, videos and
folders of pictures, ``mvpose run``, and ``simharness evaluate poses`` with the truth of the export. Joints are hidden
by people and furniture, and crops are resampled, so the keypoints have errors of their own; how good trained networks
are is not measured. Keypoints lie on the surface of bodies, elsewhere for each camera: in four seconds of such people
the doctor takes a camera for wrong (it finds nothing wrong with the export's own detections).
"""
