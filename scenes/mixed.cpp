#include <array>

#include "scenes/catalogue.hpp"

namespace stiction::scenes {
namespace {

/// The number of contacts wanted. One environment of ten has none. Otherwise P(more than k) = 12 / (k + 12), a tail so
/// heavy that the mean is set by the limit.
int draw_contact_count(Rng& rng, int limit) {
  constexpr double kScale = 12;
  if (rng.chance(0.1)) return 0;
  const double u = rng.uniform();
  if (kScale - kScale * u >= u * limit) return limit;
  const int count = static_cast<int>(kScale / u - kScale);
  return count < 1 ? 1 : count;
}

/// Largest size whose contacts, by the layout's own count, stay within the limit; at least 1.
template <class ContactsOf>
int largest_size(int limit, ContactsOf contacts_of) {
  int size = 1;
  while (contacts_of(size + 1) <= limit) ++size;
  return size;
}

int wall_contacts(int courses) {
  return 8 * courses * courses - 4 * courses;
}
int pyramid_contacts(int levels) {
  int contacts = 4 * levels * levels;
  for (int k = 1; k < levels; ++k) contacts += 16 * k * k;
  return contacts;
}

int contact_count(const SceneEnv& env) {
  int count = 0;
  for (const auto& cone : env.system.cones) count += cone.kind == ConeKind::friction ? 1 : 0;
  return count;
}

SceneEnv pile_within(Rng& rng, int limit) {
  // The number of contacts that spheres settle into is known afterwards; each try continues the random stream.
  int spheres = (limit + 2) / 3;
  SceneEnv env = make_pile(rng, spheres);
  while (contact_count(env) > limit && spheres > 1) {
    spheres -= (spheres + 9) / 10;
    env = make_pile(rng, spheres);
  }
  return contact_count(env) > limit ? make_stack(rng, 1) : std::move(env);
}

/// Scenes of at most 16 contacts.
SceneEnv make_small(Rng& rng, int limit) {
  switch (rng.below(4)) {
    case 0:
      return make_walker(rng, limit < 4 ? 2 : 4);
    case 1:
      return limit < 8 ? make_walker(rng, 2) : make_grasp(rng, limit < 10 ? 3 : 4);
    case 2: {
      const auto kind = rng.next();
      return make_adversarial(rng, kind, limit < 16 ? 1 : limit / 16 < 4 ? limit / 16 : 4);
    }
    default:
      return make_column(rng, limit);
  }
}

}  // namespace

SceneEnv make_mixed(Rng& rng, int contact_limit) {
  const int wanted = draw_contact_count(rng, contact_limit);
  if (wanted == 0) return make_free_flight(rng);
  if (wanted < 4 || (wanted < 32 && rng.chance(0.5))) return make_small(rng, wanted);
  switch (rng.below(5)) {
    case 0:
      return make_stack(rng, wanted / 4);
    case 1:
      return make_wall(rng, largest_size(wanted, wall_contacts));
    case 2:
      return make_pyramid(rng, largest_size(wanted, pyramid_contacts));
    case 3:
      return pile_within(rng, wanted);
    default:
      return make_chain(rng, 2 * wanted);
  }
}

}  // namespace stiction::scenes
