"""A single touch's force comes off its curve to the noise's own accuracy; nothing else is changed."""

import numpy as np
import torch

from ertskin.data.trials import TrialSet
from ertskin.models.single_touch import SingleTouch

TAXELS, COMPONENTS = 3, 10


def response(taxel, force):
    """Saturating curves in units of the noise, another direction for each taxel, bending with the force."""
    rng = np.random.default_rng(taxel)
    first, second = rng.standard_normal((2, COMPONENTS))
    return 100 * (np.outer(1 - np.exp(-force / 3), first) + 0.2 * np.outer(np.sin(force / 3), second))


def trials():
    force = np.tile(np.linspace(0.2, 10, 40), TAXELS)
    taxel = np.repeat(np.arange(TAXELS), 40)
    maps = np.zeros((len(force), TAXELS))
    maps[np.arange(len(force)), taxel] = force
    values = np.concatenate([response(k, force[taxel == k]) for k in range(TAXELS)])
    contact = np.zeros((len(force), 1, 2))
    return TrialSet(values, maps, contact, force[:, None]), torch.from_numpy(values).float()


def fitted():
    single = SingleTouch(TAXELS, COMPONENTS)
    single.fit(*trials())
    return single


def test_a_single_touch_is_read_off_its_curve():
    rng = np.random.default_rng(0)
    force = rng.uniform(0.3, 9.5, 200)
    seen = response(1, force) + rng.standard_normal((200, COMPONENTS))
    logit = torch.tensor([[-5.0, 5.0, -5.0]]).expand(200, -1)
    given = torch.full((200, TAXELS), 4.0)
    answer = fitted()(torch.from_numpy(seen).float(), logit, given, 0.5).numpy()
    slope = np.linalg.norm(response(1, force + 0.01) - response(1, force), axis=1) / 0.01
    assert np.sqrt(np.mean(((answer[:, 1] - force) * slope) ** 2)) < 1.3
    assert (answer[:, [0, 2]] == 4.0).all()


def test_two_touches_none_and_an_unfitted_one_keep_the_networks_answer():
    seen = torch.from_numpy(response(1, np.array([5.0, 5.0]))).float()
    given = torch.full((2, TAXELS), 4.0)
    several = torch.tensor([[5.0, 5.0, -5.0], [-5.0, -5.0, -5.0]])
    assert torch.equal(fitted()(seen, several, given, 0.5), given)
    one = torch.tensor([[-5.0, 5.0, -5.0]]).expand(2, -1)
    assert torch.equal(SingleTouch(TAXELS, COMPONENTS)(seen, one, given, 0.5), given)
