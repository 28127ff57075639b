#include "scenes/scenes.hpp"

#include <array>

#include "core/base/fp_env.hpp"
#include "scenes/catalogue.hpp"
#include "stiction/error.hpp"

namespace stiction::scenes {
namespace {

struct Scene {
  const char* name;
  const char* summary;
  Law law;
  int default_size, min_size, max_size;
  SceneEnv (*build)(Rng& rng, std::uint64_t index, int size);
};

template <SceneEnv (*Build)(Rng&, int)>
SceneEnv without_index(Rng& rng, std::uint64_t, int size) {
  return Build(rng, size);
}

constexpr std::array kScenes{
    Scene{"stack", "boxes on top of each other, 4 contacts per interface; size: boxes", Law::coulomb, 5, 1, 10000,
          without_index<make_stack>},
    Scene{"wall", "bricks in running bond; size: courses, and bricks per course", Law::coulomb, 5, 1, 100,
          without_index<make_wall>},
    Scene{"pyramid", "boxes, each on four below; size: levels", Law::coulomb, 3, 1, 30, without_index<make_pyramid>},
    Scene{"pile", "spheres settled in a bin; size: spheres", Law::coulomb, 24, 1, 4000, without_index<make_pile>},
    Scene{"chain", "links on ball joints (free rows), half hanging, half on the ground; size: links", Law::coulomb, 20,
          2, 10000, without_index<make_chain>},
    Scene{"column", "unit masses on one vertical line, tridiagonal A; size: bodies", Law::coulomb, 20, 1, 100000,
          without_index<make_column>},
    Scene{"grasp", "articulated hand on a box, torsional friction, limits, joint friction; size: fingers", Law::convex,
          4, 2, 8, without_index<make_grasp>},
    Scene{"walker", "articulated robot on rough ground, limits, joint friction; size: legs", Law::convex, 4, 2, 16,
          without_index<make_walker>},
    Scene{"mixed", "draws among the other scenes, heavy-tailed sizes; size: largest number of contacts", Law::coulomb,
          kMixedContactLimit, 16, kMixedContactLimit, without_index<make_mixed>},
    Scene{"adversarial", "eight kinds of trouble in turn; size: bodies, or contacts along an edge", Law::coulomb, 8, 1,
          8, make_adversarial},
};

std::uint64_t stream_key(const Scene& scene, std::uint64_t seed, std::uint64_t index, int size) {
  std::uint64_t key = 0;
  for (const char* c = scene.name; *c != '\0'; ++c) key = mix_bits(key + static_cast<unsigned char>(*c));
  key = mix_bits(key ^ seed);
  key = mix_bits(key + index);
  return mix_bits(key + static_cast<std::uint64_t>(size));
}

const Scene& find_scene(const std::string& name) {
  for (const Scene& scene : kScenes) {
    if (name == scene.name) return scene;
  }
  std::string names;
  for (const Scene& scene : kScenes) names += (names.empty() ? "" : ", ") + std::string(scene.name);
  throw Error(ErrorCode::invalid_argument, "scene '" + name + "' does not exist: choose one of " + names);
}

}  // namespace

std::vector<SceneInfo> list() {
  std::vector<SceneInfo> infos;
  for (const Scene& scene : kScenes) infos.push_back({scene.name, scene.summary, scene.law});
  return infos;
}

SceneEnv make(const std::string& name, std::uint64_t seed, std::uint64_t index, int size) {
  const ScopedFpEnv fp_env;
  const Scene& scene = find_scene(name);
  if (size == 0) size = scene.default_size;
  if (size < scene.min_size || size > scene.max_size) {
    throw Error(ErrorCode::invalid_argument, "size " + std::to_string(size) + " of scene '" + name +
                                                 "' is out of range: choose " + std::to_string(scene.min_size) +
                                                 " to " + std::to_string(scene.max_size) +
                                                 ", or 0 for the default of " + std::to_string(scene.default_size));
  }
  Rng rng(stream_key(scene, seed, index, size));
  return scene.build(rng, index, size);
}

}  // namespace stiction::scenes
