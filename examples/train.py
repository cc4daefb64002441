"""Train a network on animated meshes in `.reel` files.

    python examples/train.py
    python examples/train.py captures/ --epochs 20

A small network learns to predict each vertex of the next frame from the three frames before.
Without a folder, it first compresses a data set of simulated flags. Needs the extra [torch].
"""

import argparse
import sys
import tempfile
from pathlib import Path

import meshreel

try:
    import torch
    from torch.utils.data import DataLoader

    from meshreel.torch import Batch, ReelDataset, ReelStream, collate
except ModuleNotFoundError as error:
    sys.exit(f"this example needs PyTorch: pip install 'meshreel[torch]' ({error})")

SIDES = (24, 28, 32)
"""Vertices along a side of each flag of the data set."""


def write_flags(folder: Path) -> None:
    """Write the data set."""
    for side in SIDES:
        flag = meshreel.simulate_flag(60, n_rows=side, n_columns=side)
        meshreel.save(flag, folder / f"flag{side}.reel")


class NextFrame(torch.nn.Module):
    """Predicts positions (B, V, 3) from three frames (B, 3, V, 3): constant velocity, corrected."""

    def __init__(self) -> None:
        super().__init__()
        self.correction = torch.nn.Sequential(
            torch.nn.Linear(6, 64), torch.nn.SiLU(), torch.nn.Linear(64, 3)
        )

    def forward(self, frames: torch.Tensor) -> torch.Tensor:
        """Return the next positions."""
        before, last = frames[:, 1] - frames[:, 0], frames[:, 2] - frames[:, 1]
        scale = 100  # motions of a frame are about a hundredth of the model
        features = torch.cat([before, last], dim=-1) * scale
        predicted: torch.Tensor = frames[:, 2] + last + self.correction(features) / scale
        return predicted


def mean_square(predicted: torch.Tensor, batch: Batch) -> torch.Tensor:
    """Return the mean squared distance of vertices from the fourth frame, without the padding."""
    squared = (predicted - batch.vertices[:, 3]).square().sum(dim=-1)
    is_vertex = torch.arange(squared.shape[1]) < batch.n_verts[:, None]
    return squared[is_vertex].mean()


def main() -> None:
    """Train, and print the error of each epoch and that of constant velocity."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", help="a folder of .reel files")
    parser.add_argument("--epochs", type=int, default=5)
    arguments = parser.parse_args()
    torch.manual_seed(0)
    model = NextFrame()
    optimizer = torch.optim.AdamW(model.parameters(), lr=3e-3)
    with tempfile.TemporaryDirectory() as made:
        if arguments.folder is None:
            write_flags(Path(made))
        dataset = ReelDataset(arguments.folder or made, window=4, normalize=True)
        loader = DataLoader(ReelStream(dataset), batch_size=8, collate_fn=collate)
        print(f"{len(dataset)} windows of {len(dataset.sequences)} sequences")
        for epoch in range(arguments.epochs):
            losses = []
            for batch in loader:
                error = mean_square(model(batch.vertices[:, :3]), batch)
                optimizer.zero_grad()
                (1e6 * error).backward()
                optimizer.step()
                constant = mean_square(2 * batch.vertices[:, 2] - batch.vertices[:, 1], batch)
                losses.append((error.item(), constant.item()))
            ours, constant_velocity = 100 * torch.tensor(losses).mean(dim=0).sqrt()
            print(
                f"epoch {epoch}: RMS error {ours:.3f} % of the diagonal, "
                f"{constant_velocity:.3f} % at constant velocity"
            )


if __name__ == "__main__":
    main()
