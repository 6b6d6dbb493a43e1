"""Training of the re-ID network: margin softmax and triplet loss, with augmented crops."""

from __future__ import annotations

import copy
import functools
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
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

Item = TypeVar("Item")

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

_SCALE, _MARGIN, _SMOOTHING = 24.0, 0.2, 0.05  # scale, margin and label smoothing of the softmax over identities
_TRIPLET_MARGIN = 0.3
_BATCH = (4, 3, 2, 4)  # sites, groups per site, people per group, crops per person
_RATE, _DECAY = 2.5e-3, 0.02  # learning rate and weight decay
_COARSE = 0.4  # fraction of the epochs on crops of half the size, at the start: they cost a third of the time


@dataclass(frozen=True)
class Progress:
    """Progress of a training.

    Attributes:
        epoch: number of completed epochs.
        epochs: total number of epochs.
        identities, triplets: mean losses of the last epoch.
        seconds: time since the start.
    """

    epoch: int
    epochs: int
    identities: float
    triplets: float
    seconds: float


def train(
    crops: Crops, *, seed: int, epochs: int, threads: int = 1, report: Callable[[Progress], None] = lambda _: None
) -> Network:
    """Train a network, on CUDA if it is available.

    The loss is the sum of a softmax over the training identities with an additive margin (Wang et al., "CosFace", CVPR
    2018) and the triplet loss with the hardest positive and negative of each crop in its batch (Hermans et al., "In
    defense of the triplet loss", 2017). A batch has several people of the same group, so that it contains people
    dressed alike. The convolutions run in bfloat16 where the processor has instructions for it; the descriptors and
    losses stay in float32.

    Args:
        crops: training crops.
        seed: seed of the initial weights, the batches and the augmentation.
        epochs: number of passes over all crops.
        threads: number of threads on a CPU. Each computes the gradients of a part of every batch, with the statistics
            of that part, so another number gives a slightly different network.
        report: called after every epoch.
    """
    torch.manual_seed(seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    identity = torch.from_numpy(crops.identity)
    network = Network().to(device).train()
    for weights in network.parameters():
        if weights.ndim == 4:  # convolutions run faster in this layout
            weights.data = weights.data.contiguous(memory_format=torch.channels_last)
    centers = nn.Parameter(functional.normalize(torch.randn(int(identity.max()) + 1, DIMENSIONS), dim=1).to(device))
    batches = Batches(crops, seed)
    optimizer = torch.optim.AdamW(
        [{"params": network.parameters(), "weight_decay": _DECAY}, {"params": [centers], "weight_decay": 0.0}],
        lr=_RATE,
        fused=True,
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, _RATE, total_steps=epochs * len(batches), pct_start=0.15, div_factor=10, final_div_factor=100
    )
    images = torch.from_numpy(crops.images)
    count = 1 if device.type == "cuda" else threads
    twins = [network, *(_twin(network) for _ in range(count - 1))]
    learners = [_Learner(twin, centers, torch.Generator().manual_seed(seed + k)) for k, twin in enumerate(twins)]
    start = time.perf_counter()
    with ThreadPoolExecutor(count, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for epoch in range(epochs):
            sums, coarse = np.zeros(2), epoch < int(_COARSE * epochs)
            for rows in batches.epoch(epoch):
                parts = [part for part in rows.chunk(count) if len(part) > 1]
                steps = [
                    pool.submit(learner.gradients, images[part], identity[part], coarse)
                    for learner, part in zip(learners, parts, strict=False)
                ]
                found = [step.result() for step in steps]
                for weight, *gradients in zip(learners[0].weights, *(each for each, _ in found), strict=True):
                    weight.grad = sum(gradients[1:], gradients[0]) / len(found)
                optimizer.step()
                schedule.step()
                sums += np.mean([losses for _, losses in found], axis=0)
            identities, triplets = (sums / len(batches)).tolist()
            report(Progress(epoch + 1, epochs, identities, triplets, time.perf_counter() - start))
    return network.cpu().eval()


def _twin(network: Network) -> Network:
    """Return a network with the same weights, not copies of them, and its own statistics of batches."""
    twin = copy.deepcopy(network)
    for module, original in zip(twin.modules(), network.modules(), strict=True):
        module._parameters = original._parameters
    return twin


@dataclass(frozen=True)
class _Learner:
    """Computation of the gradients for a part of a batch, in one thread.

    Attributes:
        network: network, or a twin of it.
        centers: centres of the identities, (I, D).
        generator: random numbers of the augmentation.
    """

    network: Network
    centers: nn.Parameter
    generator: torch.Generator

    @property
    def weights(self) -> list[nn.Parameter]:
        """Everything that is trained."""
        return [*self.network.parameters(), self.centers]

    def gradients(self, images: Tensor, labels: Tensor, coarse: bool) -> tuple[tuple[Tensor, ...], list[float]]:
        """Return the gradients of the weights, and the losses.

        Args:
            images: crops, (n, 128, 64, 3) uint8.
            labels: their identities, (n,).
            coarse: whether to halve the size of the crops.
        """
        device = self.centers.device
        batch = augment(images, self.generator)
        batch = (functional.avg_pool2d(batch, 2) if coarse else batch).to(device, memory_format=torch.channels_last)
        labels = labels.to(device)
        with torch.autocast(device.type, torch.bfloat16, enabled=_multiplies_short_numbers(device)):
            features = self.network.trunk(batch)
        descriptors = self.network.describe(features.float())
        losses = margin_loss(descriptors, self.centers, labels), triplet_loss(descriptors, labels)
        return torch.autograd.grad(torch.stack(losses).sum(), self.weights), [float(loss.detach()) for loss in losses]


@functools.cache
def _multiplies_short_numbers(device: torch.device) -> bool:
    """Return whether a device multiplies matrices of bfloat16 (AMX on a CPU), twice as fast for these convolutions."""
    return device.type == "cuda" or bool(torch.cpu.get_capabilities().get("amx_bf16", False))


class Batches:
    """Sampler of batches: several sites, groups per site, people per group and crops per person.

    So every batch compares people in the same light and people dressed alike.
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
        """Draw the rows of every batch of an epoch."""
        rng = stream(self._seed, "train", "batches", number)
        for _ in range(self._length):
            groups = [group for site in choose(rng, self._sites, _BATCH[0]) for group in choose(rng, site, _BATCH[1])]
            people = [rows for group in groups for rows in choose(rng, group, _BATCH[2])]
            chosen = [rng.choice(rows, _BATCH[3], replace=len(rows) < _BATCH[3]) for rows in people]
            yield torch.from_numpy(np.concatenate(chosen))


def choose(rng: np.random.Generator, items: Sequence[Item], count: int) -> list[Item]:
    """Draw ``count`` different items, or all of them in random order if there are fewer."""
    return [items[int(k)] for k in rng.choice(len(items), min(count, len(items)), replace=False)]


def margin_loss(descriptors: Tensor, centers: Tensor, labels: Tensor) -> Tensor:
    """Return the cross-entropy of a softmax over scaled cosines, that of the correct identity lowered by a margin.

    Args:
        descriptors: unit descriptors, (n, D).
        centers: centres of the identities, (I, D).
        labels: identities of the crops, (n,).
    """
    cosine = descriptors @ functional.normalize(centers, dim=1).T
    lowered = cosine - _MARGIN * functional.one_hot(labels, len(centers))
    return functional.cross_entropy(_SCALE * lowered, labels, label_smoothing=_SMOOTHING)


def triplet_loss(descriptors: Tensor, labels: Tensor) -> Tensor:
    """Return the batch-hard triplet loss of unit descriptors (n, D) with identities (n,)."""
    distance = (2 - 2 * descriptors @ descriptors.T).clamp(min=1e-6).sqrt()
    same = labels[:, None] == labels
    farthest = torch.where(same, distance, -torch.inf).amax(dim=1)
    nearest = torch.where(same, torch.inf, distance).amin(dim=1)
    return functional.relu(farthest - nearest + _TRIPLET_MARGIN).mean()


def augment(images: Tensor, generator: torch.Generator) -> Tensor:
    """Convert crops (n, 128, 64, 3) uint8 to the input of the network, randomly mirrored, moved, tinted and covered."""
    n, height, width = images.shape[:3]
    drawn = torch.rand((16, n), generator=generator)
    normal = torch.randn((7, n), generator=generator)
    fill = torch.tensor(FILL).view(1, 3, 1, 1) / 255
    light = torch.add(-fill, images.permute(0, 3, 1, 2), alpha=1 / 255)  # differences from the fill colour

    # Mirror, shift and scale. Pixels outside the crop get the fill colour, which normalisation maps to 0.
    turn = torch.where(drawn[0] < 0.5, -1.0, 1.0)
    zeros = torch.zeros(n)
    theta = torch.stack(
        [
            torch.stack([turn * (1 + 0.05 * normal[0].clamp(-2, 2)), zeros, 0.06 * normal[1].clamp(-2, 2)], 1),
            torch.stack([zeros, 1 + 0.04 * normal[2].clamp(-2, 2), 0.04 * normal[3].clamp(-2, 2)], 1),
        ],
        1,
    )
    grid = functional.affine_grid(theta, [n, 3, height, width], align_corners=False)
    light = functional.grid_sample(light, grid, align_corners=False)

    # Change tint, brightness and contrast about the mean: one factor and one summand for each crop and colour.
    gain = torch.exp(0.12 * normal[4])[:, None] * torch.exp(
        torch.stack([0.08 * normal[5], torch.zeros(n), 0.08 * normal[6]], 1)
    )
    gain, contrast = gain[:, :, None, None], (0.8 + 0.4 * drawn[1])[:, None, None, None]
    middle = (gain * (light.mean(dim=(2, 3), keepdim=True) + fill)).mean(dim=1, keepdim=True)
    light = torch.addcmul(contrast * gain * fill + (1 - contrast) * middle, light, contrast * gain)

    # Cover a rectangle by a patch of another crop or by a uniform colour.
    covered = torch.nonzero(drawn[6] < 0.4)[:, 0]
    under, (tall, wide) = light[covered], (0.15 + 0.35 * drawn[2, covered], 0.25 + 0.5 * drawn[3, covered])
    tall, wide = tall * height, wide * width
    top, left = drawn[4, covered] * (height - tall), drawn[5, covered] * (width - wide)
    y, x = torch.arange(height)[None, :, None], torch.arange(width)[None, None, :]
    patch = (y >= top[:, None, None]) & (y < (top + tall)[:, None, None])
    patch = patch & (x >= left[:, None, None]) & (x < (left + wide)[:, None, None])
    flat = drawn[8:11, covered].T[:, :, None, None].expand_as(under)
    other = light[(covered + n // 2) % n]
    cover = torch.where((drawn[7, covered] < 0.6)[:, None, None, None], other, flat)
    light[covered] = torch.where(patch[:, None], cover, under)

    mean, std = (torch.tensor(values).view(1, 3, 1, 1) for values in (MEAN, STD))
    return torch.addcmul(-mean / std, light.clamp_(0, 1), 1 / std)


def export(network: Network, path: Path) -> None:
    """Write :class:`Mirrored` of the network as ONNX, from ``crops`` (n, 3, 128, 64) to ``descriptors`` (n, 192)."""
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
