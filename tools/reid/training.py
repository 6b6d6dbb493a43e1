"""Learning to tell people apart: margins between identities, hard pairs, crops changed in colour and covered."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from simharness.types.random_streams import stream
from tools.reid.crops import FILL, Crops
from tools.reid.network import DIMENSIONS, Mirrored, Network

Thing = TypeVar("Thing")

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

_SCALE, _MARGIN, _SMOOTHING = 24.0, 0.2, 0.05  # of the softmax over identities
_TRIPLET_MARGIN = 0.3
_BATCH = (4, 3, 2, 4)  # sites, groups of each, people of each, crops of each
_RATE, _DECAY = 2.5e-3, 0.02


@dataclass(frozen=True)
class Progress:
    """Where training is: epochs done of all, the epoch's mean losses, seconds since it began."""

    epoch: int
    epochs: int
    identities: float
    triplets: float
    seconds: float


def train(
    crops: Crops, *, seed: int, epochs: int, threads: int = 1, report: Callable[[Progress], None] = lambda _: None
) -> Network:
    """Train a network; on CUDA where PyTorch finds it.

    Two losses: a softmax over the training identities with an additive margin (Wang et al., "CosFace", CVPR 2018), and
    the hardest positive and negative of each crop in its batch (Hermans et al., "In defense of the triplet loss",
    2017). Batches take several people of one group, so those dressed alike meet.

    Args:
        crops: to learn from.
        seed: of the first weights, the batches and the changes.
        epochs: times over all crops.
        threads: of PyTorch on a CPU. Another number may change the last digits.
        report: called after every epoch.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    identity = torch.from_numpy(crops.identity)
    network = Network().to(device)
    for weights in network.parameters():
        if weights.ndim == 4:  # convolutions run faster so
            weights.data = weights.data.contiguous(memory_format=torch.channels_last)
    centers = nn.Parameter(functional.normalize(torch.randn(int(identity.max()) + 1, DIMENSIONS), dim=1).to(device))
    batches = Batches(crops, seed)
    optimizer = torch.optim.AdamW(
        [{"params": network.parameters(), "weight_decay": _DECAY}, {"params": [centers], "weight_decay": 0.0}], lr=_RATE
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, _RATE, total_steps=epochs * len(batches), pct_start=0.15, div_factor=10, final_div_factor=100
    )
    changes = torch.Generator().manual_seed(seed)
    images = torch.from_numpy(crops.images)
    start = time.perf_counter()
    for epoch in range(epochs):
        network.train()
        sums = np.zeros(2)
        for rows in batches.epoch(epoch):
            batch = changed(images[rows], changes).to(device, memory_format=torch.channels_last)
            who = identity[rows].to(device)
            descriptors = network(batch)
            losses = margin_loss(descriptors, centers, who), triplet_loss(descriptors, who)
            optimizer.zero_grad(set_to_none=True)
            torch.stack(losses).sum().backward()
            optimizer.step()
            schedule.step()
            sums += [float(loss.detach()) for loss in losses]
        identities, triplets = (sums / len(batches)).tolist()
        report(Progress(epoch + 1, epochs, identities, triplets, time.perf_counter() - start))
    return network.cpu().eval()


class Batches:
    """Which crops learn together: from some sites several groups, some people of each, some crops of each person.

    So everyone meets people in the same light, and people dressed alike.
    """

    def __init__(self, crops: Crops, seed: int) -> None:
        self._seed = seed
        identity = crops.identity
        order = np.argsort(identity, kind="stable")
        sites: dict[int, dict[int, list[NDArray[np.intp]]]] = {}
        for rows in np.split(order, np.flatnonzero(np.diff(identity[order])) + 1):
            groups = sites.setdefault(int(crops.site[rows[0]]), {})
            groups.setdefault(int(crops.seed[rows[0]]), []).append(rows)
        self._sites = [list(groups.values()) for groups in sites.values()]
        self._length = max(1, len(crops) // int(np.prod(_BATCH)))

    def __len__(self) -> int:
        return self._length

    def epoch(self, number: int) -> Iterator[Tensor]:
        """Rows of every batch of an epoch."""
        rng = stream(self._seed, "train", "batches", number)
        for _ in range(self._length):
            groups = [group for site in some(rng, self._sites, _BATCH[0]) for group in some(rng, site, _BATCH[1])]
            people = [rows for group in groups for rows in some(rng, group, _BATCH[2])]
            chosen = [rng.choice(rows, _BATCH[3], replace=len(rows) < _BATCH[3]) for rows in people]
            yield torch.from_numpy(np.concatenate(chosen))


def some(rng: np.random.Generator, things: Sequence[Thing], count: int) -> list[Thing]:
    """As many different ones as asked for, or all of them where there are not so many."""
    return [things[int(k)] for k in rng.choice(len(things), min(count, len(things)), replace=False)]


def margin_loss(descriptors: Tensor, centers: Tensor, who: Tensor) -> Tensor:
    """Softmax over identities of scaled cosines, the right one lowered by a margin."""
    cosine = descriptors @ functional.normalize(centers, dim=1).T
    lowered = cosine - _MARGIN * functional.one_hot(who, len(centers))
    return functional.cross_entropy(_SCALE * lowered, who, label_smoothing=_SMOOTHING)


def triplet_loss(descriptors: Tensor, who: Tensor) -> Tensor:
    """By how much the farthest crop of one's own is not nearer, by a margin, than the nearest of others."""
    distance = (2 - 2 * descriptors @ descriptors.T).clamp(min=1e-6).sqrt()
    same = who[:, None] == who
    farthest = torch.where(same, distance, -torch.inf).amax(dim=1)
    nearest = torch.where(same, torch.inf, distance).amin(dim=1)
    return functional.relu(farthest - nearest + _TRIPLET_MARGIN).mean()


def normalised(images: Tensor) -> Tensor:
    """Crops (n, 128, 64, 3) uint8 as the network wants them, (n, 3, 128, 64)."""
    mean, std = (torch.tensor(values).view(3, 1, 1) for values in (MEAN, STD))
    return (images.permute(0, 3, 1, 2).float() / 255 - mean) / std


def changed(images: Tensor, generator: torch.Generator) -> Tensor:
    """Normalised crops (n, 3, 128, 64), mirrored, moved, tinted and covered by chance."""
    n, height, width = images.shape[:3]
    drawn = torch.rand((16, n), generator=generator)
    normal = torch.randn((7, n), generator=generator)
    light = images.permute(0, 3, 1, 2).float() / 255

    # Mirrored, and cut a little beside the box. Beyond it is the colour that normalisation makes 0.
    turn = torch.where(drawn[0] < 0.5, -1.0, 1.0)
    zeros = torch.zeros(n)
    theta = torch.stack(
        [
            torch.stack([turn * (1 + 0.05 * normal[0].clamp(-2, 2)), zeros, 0.06 * normal[1].clamp(-2, 2)], 1),
            torch.stack([zeros, 1 + 0.04 * normal[2].clamp(-2, 2), 0.04 * normal[3].clamp(-2, 2)], 1),
        ],
        1,
    )
    fill = torch.tensor(FILL).view(1, 3, 1, 1) / 255
    grid = functional.affine_grid(theta, [n, 3, height, width], align_corners=False)
    light = functional.grid_sample(light - fill, grid, align_corners=False) + fill

    # Tinted, brighter or darker, more or less contrast.
    gain = torch.exp(0.10 * normal[4])[:, None] * torch.exp(
        torch.stack([0.06 * normal[5], torch.zeros(n), 0.06 * normal[6]], 1)
    )
    light = light * gain[:, :, None, None]
    middle = light.mean(dim=(1, 2, 3), keepdim=True)
    light = middle + (light - middle) * (0.8 + 0.4 * drawn[1])[:, None, None, None]

    # Covered: by a patch of another crop, or by a flat colour.
    y, x = torch.arange(height)[None, :, None], torch.arange(width)[None, None, :]
    tall, wide = (0.15 + 0.35 * drawn[2]) * height, (0.25 + 0.5 * drawn[3]) * width
    top, left = drawn[4] * (height - tall), drawn[5] * (width - wide)
    patch = (y >= top[:, None, None]) & (y < (top + tall)[:, None, None])
    patch = patch & (x >= left[:, None, None]) & (x < (left + wide)[:, None, None]) & (drawn[6] < 0.4)[:, None, None]
    flat = drawn[8:11].T[:, :, None, None].expand_as(light)
    cover = torch.where((drawn[7] < 0.6)[:, None, None, None], light.roll(n // 2 + 1, dims=0), flat)
    light = torch.where(patch[:, None], cover, light).clamp(0, 1)

    mean, std = (torch.tensor(values).view(3, 1, 1) for values in (MEAN, STD))
    return (light - mean) / std


def export(network: Network, path: Path) -> None:
    """Write the network, :class:`Mirrored`, as ONNX: ``crops`` (n, 3, 128, 64) to ``descriptors`` (n, 192)."""
    crop = torch.zeros(2, 3, 128, 64)
    torch.onnx.export(
        Mirrored(network).eval(),
        (crop,),
        str(path),
        input_names=["crops"],
        output_names=["descriptors"],
        dynamic_axes={"crops": {0: "n"}, "descriptors": {0: "n"}},
        opset_version=17,
        dynamo=False,
    )
