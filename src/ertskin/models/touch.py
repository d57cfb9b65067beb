"""Networks that say which taxels are touched and how hard: a binary mask times a force (paper IV-A)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ertskin.data.trials import TrialSet
from ertskin.models.estimate import Estimate
from ertskin.models.network import Network


class TouchNetwork(Network):
    """A network whose last layer gives a logit and a force in newton for each taxel.

    A taxel is declared touched where the sigmoid of its logit exceeds ``threshold``; its force counts only there.
    """

    def __init__(self, taxel_m: list[list[float]], threshold: float) -> None:
        super().__init__()
        self.threshold = threshold
        self.register_buffer("taxel_m", torch.tensor(taxel_m))

    def scaled(self, change_v: Tensor) -> Tensor:
        """Inputs of the layers from voltage changes."""
        raise NotImplementedError

    def layers_out(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """(N,n) logits and (N,n) forces in newton from scaled inputs."""
        raise NotImplementedError

    def trials_out(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """``layers_out`` of the inputs ``prepare`` made, where a network holds those in another form."""
        return self.layers_out(inputs)

    def targets(self, trials: TrialSet) -> dict[str, Tensor]:
        """What is learned from each trial."""
        force = torch.from_numpy(trials.force_map_n).float()
        return {"touched": (force > 0).float(), "force_n": force}

    def losses(self, inputs: Tensor, targets: dict[str, Tensor]) -> dict[str, Tensor]:
        """Binary cross entropy of the mask, and mean square error of the force where the mask lets it through.

        The force part is trained after the contacts are identified and sees only those; the true mask stands for the
        identified one during training.
        """
        logit, force = self.trials_out(inputs)
        return {
            "location": nn.functional.binary_cross_entropy_with_logits(logit, targets["touched"]),
            "force": (targets["touched"] * (force - targets["force_n"]).square()).mean(),
        }

    @torch.no_grad()
    def estimate(self, change_v: Tensor) -> Estimate:
        """Touches of (N,D) voltage changes."""
        logit, force = self.layers_out(self.scaled(change_v))
        present = torch.sigmoid(logit) > self.threshold
        return Estimate((present * force).double().cpu().numpy(), present.cpu().numpy())
