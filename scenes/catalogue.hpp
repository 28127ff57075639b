#pragma once

#include "scenes/rng.hpp"
#include "scenes/scenes.hpp"

namespace stiction::scenes {

/// The most contacts (cones of an unactuated scene) that `mixed` lets one environment have.
inline constexpr int kMixedContactLimit = 300;

/// One function per scene: the environment that a stream of random numbers and a size give. scenes/README.md
/// describes them; sizes have been checked against the catalogue's range.
SceneEnv make_stack(Rng& rng, int boxes);
SceneEnv make_wall(Rng& rng, int courses);
SceneEnv make_pyramid(Rng& rng, int levels);
SceneEnv make_pile(Rng& rng, int spheres);
SceneEnv make_chain(Rng& rng, int links);
SceneEnv make_column(Rng& rng, int count);
SceneEnv make_grasp(Rng& rng, int fingers);
SceneEnv make_walker(Rng& rng, int legs);
SceneEnv make_mixed(Rng& rng, int contact_limit);
/// `kind` counts through the kinds of trouble, modulo their number.
SceneEnv make_adversarial(Rng& rng, std::uint64_t kind, int size);

/// A body in the air: an environment without rows.
SceneEnv make_free_flight(Rng& rng);

}  // namespace stiction::scenes
