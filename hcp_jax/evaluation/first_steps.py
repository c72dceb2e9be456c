"""v_h of new hoppers, regressed from their own first control steps (paper, section 5.2, its suggestion for HCP-I).

An identified run (`embedding.identify_steps`) holds a forward model that predicts a robot's next observation from its v_h. A
new robot acts for some steps as the training robots did while they were identified; its v_h is the one under which the
frozen model predicts these steps best, drawn a little towards the training robots' mean. Policy and model learn nothing.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import optax

from hcp_jax.algorithms.identification import forward_model_variables, prediction_loss, put_actor
from hcp_jax.algorithms.ppo import PPO, PPOState
from hcp_jax.config import ConfigError
from hcp_jax.envs.base import PoolEnv
from hcp_jax.experiment.hopper import HopperExperiment
from hcp_jax.hardware.pool import RobotPool
from hcp_jax.policies.distribution import sample_gaussian

# v_h has mean 0 and standard deviation 1 over the training robots. One control step's prediction weighs this much against that.
# Of 3, 10, 30, 100 and 300, this came nearest to the v_h that training robots learned, from 200 steps of theirs.
WEIGHT_OF_A_STEP = 100.0
UPDATES = 150
STEPS_PER_UPDATE = 100
LEARNING_RATE = 0.1


def regress_v_h(
    run: HopperExperiment, state: PPOState, pool: RobotPool, steps: Sequence[int], key: jax.Array
) -> dict[int, jax.Array]:
    """v_h [num_robots, K] of every robot of `pool` from its first n control steps, for each n of `steps`.

    Args:
        run: the experiment whose robots the networks were trained on.
        state: after its identification.
        pool: the new robots.
        steps: numbers of control steps; fewer are the beginning of more.
        key: of initial states and sampled actions.

    Raises:
        ConfigError: the run has identified no robots, or a number of steps is below 1.
    """
    if not run.learner.identify_iterations or int(state.iteration) < run.learner.identify_iterations:
        what = "expected a run with embedding.identify_steps above 0 that is past them"
        raise ConfigError(f"--first-steps: {run.config.name} has no forward model to regress v_h with; {what}")
    if min(steps) < 1:
        raise ConfigError(f"--first-steps={min(steps)}: expected at least 1")
    # Of a state that was loaded the other fields hold shapes alone.
    state = state.replace(**{field.name: None for field in dataclasses.fields(state) if field.name not in state.policy_fields})
    variables, actions = jax.jit(act, static_argnums=(0, 1, 3))(run.learner, run.make_env(pool), state, max(steps), key)
    fit = jax.jit(fit_v_h, static_argnums=0)
    return {n: fit(run.learner, state, variables[:n], actions[:n], key) for n in steps}


def act(ppo: PPO, env: PoolEnv, state: PPOState, num_steps: int, key: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The actor of the identification moves every robot of `env`, which starts again where it fell.

    Returns:
        The forward model's variables [T, N, 2 O] and the executed actions [T, N, A].
    """
    assert state.reserve is not None
    statistics = state.reserve.obs_statistics
    network, index = put_actor(state.reserve, state.params["network"]), jnp.arange(env.num_robots)
    blind = jnp.zeros((env.num_robots, ppo.conditioning.size))

    def step(env_state, key):
        key_action, key_reset = jax.random.split(key)
        obs = ppo.normalize(env_state.obs, statistics)
        mean, log_std = ppo.apply(network, obs, blind, method="act")
        action = sample_gaussian(mean, log_std, key_action)
        env_state, transition = env.step_without_reset(env_state, action)
        env_state = env.restart(env_state, transition.done, key_reset, index)
        return env_state, (forward_model_variables(transition.obs, transition.next_obs), transition.action)

    key, key_reset = jax.random.split(key)
    return jax.lax.scan(step, env.reset(key_reset, index), jax.random.split(key, num_steps))[1]


def fit_v_h(ppo: PPO, state: PPOState, variables: jax.Array, actions: jax.Array, key: jax.Array) -> jax.Array:
    """v_h [N, K] that predicts best: variables [T, N, 2 O], actions [T, N, A]. Robots share nothing but the model."""
    num_steps, num_robots = actions.shape[:2]

    def predict(obs: jax.Array, action: jax.Array, v_h: jax.Array) -> jax.Array:
        return ppo.apply(state.params["network"], obs, action, v_h, method="predict")

    def loss(v_h: jax.Array, variables: jax.Array, actions: jax.Array) -> jax.Array:
        """Of one robot: its v_h [K] and what it did, [B, 2 O] and [B, A]."""
        repeated = jnp.broadcast_to(v_h, (len(actions), *v_h.shape))
        error = prediction_loss(predict, variables, state.model_statistics, actions, repeated)
        return WEIGHT_OF_A_STEP * num_steps * error + 0.5 * jnp.sum(jnp.square(v_h))

    optimizer = optax.adam(optax.linear_schedule(LEARNING_RATE, 0.0, UPDATES))

    def update(carry, key):
        v_h, opt_state = carry
        rows = jax.random.choice(key, num_steps, (min(num_steps, STEPS_PER_UPDATE),), replace=False)
        grads = jax.vmap(jax.grad(loss), in_axes=(0, 1, 1))(v_h, variables[rows], actions[rows])
        updates, opt_state = optimizer.update(grads, opt_state)
        return (v_h + updates, opt_state), None

    start = jnp.zeros((num_robots, ppo.conditioning.size))
    (v_h, _), _ = jax.lax.scan(update, (start, optimizer.init(start)), jax.random.split(key, UPDATES))
    return v_h
