#include "bench/support/contact_batch.hpp"

#include <algorithm>
#include <cstdio>

#include "scenes/scenes.hpp"

namespace stiction::bench {

namespace {

constexpr Index kRows = 3;
constexpr Index kMostContacts = 64;

/// Environment `index` of the family, with at least that many contacts.
Environment<double> make_scene(const std::string& family, Index contacts, Offset index, std::uint64_t seed) {
  const auto i = static_cast<std::uint64_t>(index);
  if (family == "stack") return scenes::make("stack", seed, i, (contacts + 3) / 4).system;
  // Kind 1 of every eight is the crowded face; size 8 makes it 8 x 8 contacts.
  if (family == "face") return scenes::make("adversarial", seed, 8 * i + 1, 8).system;
  throw Error(ErrorCode::invalid_argument, "family '" + family + "' is unknown: use stack or face");
}

bool is_plain_contact(const Environment<double>& scene, Index cone) {
  const auto& c = scene.cones[static_cast<std::size_t>(cone)];
  const std::size_t row = kRows * static_cast<std::size_t>(cone);
  return c.kind == ConeKind::friction && c.row_count == kRows && scene.mu[row + 1] == scene.mu[row + 2];
}

/// The principal subsystem of the first `contacts` cones.
Environment<double> first_contacts(const Environment<double>& scene, Index contacts) {
  if (static_cast<Index>(scene.cones.size()) < contacts)
    throw Error(ErrorCode::invalid_argument, "the scene has " + std::to_string(scene.cones.size()) +
                                                 " contacts, not the " + std::to_string(contacts) +
                                                 " asked for: ask for fewer");
  for (Index c = 0; c < contacts; ++c)
    if (!is_plain_contact(scene, c))
      throw Error(ErrorCode::invalid_argument, "cone " + std::to_string(c) +
                                                   " of the scene is no contact of three rows with one mu: the "
                                                   "baselines read no other kind, use another family");
  const Index n = kRows * contacts;
  const auto keep = [n](const std::vector<double>& values) {
    const auto wanted = static_cast<std::ptrdiff_t>(std::min(values.size(), static_cast<std::size_t>(n)));
    return std::vector<double>(values.begin(), values.begin() + wanted);
  };
  Environment<double> part;
  part.cones.assign(scene.cones.begin(), scene.cones.begin() + contacts);
  part.b = keep(scene.b);
  part.R = keep(scene.R);
  part.mu = keep(scene.mu);
  part.lo = keep(scene.lo);
  part.hi = keep(scene.hi);
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    const auto end = static_cast<std::size_t>(scene.row_offsets[i + 1]);
    for (auto k = static_cast<std::size_t>(scene.row_offsets[i]); k < end; ++k) {
      if (scene.column[k] >= n) continue;
      part.column.push_back(scene.column[k]);
      part.A.push_back(scene.A[k]);
    }
    part.row_offsets.push_back(static_cast<Index>(part.column.size()));
  }
  return part;
}

}  // namespace

std::vector<std::string> families() {
  return {"stack", "face"};
}

template <class Real>
ContactBatch<Real> make_contacts(const std::string& family, Index contacts, Offset envs, std::uint64_t seed) {
  if (contacts < 1 || contacts > kMostContacts)
    throw Error(ErrorCode::invalid_argument,
                "contacts is " + std::to_string(contacts) + ": use 1 to " + std::to_string(kMostContacts));
  if (envs < 1) throw Error(ErrorCode::invalid_argument, "envs is " + std::to_string(envs) + ": use 1 or more");
  ContactBatch<double> distinct(Law::coulomb);
  for (Offset i = 0; i < std::min(envs, kDistinct); ++i)
    distinct.add(first_contacts(make_scene(family, contacts, i, seed), contacts));
  std::vector<Offset> order(static_cast<std::size_t>(envs));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Offset>(i) % kDistinct;
  return gather<Real>(convert<Real>(distinct), order);
}

Offset capped_envs(Index contacts, Offset wanted, Offset entries) {
  constexpr Offset kFewest = 16;
  const Offset square = Offset{kRows * contacts} * (kRows * contacts);
  return std::min(wanted, std::max(kFewest, entries / square));
}

SolverOptions fixed_sweeps(SolverKind solver, Index sweeps) {
  SolverOptions options;
  options.solver = solver;
  options.tolerance = 0;
  options.max_iterations = sweeps;
  options.stall_window = 0;
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  return options;
}

template <class Real>
double worst_residual(const ContactBatch<Real>& batch, const std::vector<Real>& lambda) {
  double worst = 0;
  for (const Residual& residual : verify(batch.view(), std::span<const Real>(lambda)))
    if (!(residual.relative <= worst)) worst = residual.relative;
  return worst;
}

template <class Real>
std::string hash_text(const std::vector<Real>& lambda) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash_bits(lambda)));
  return text;
}

template ContactBatch<float> make_contacts(const std::string&, Index, Offset, std::uint64_t);
template ContactBatch<double> make_contacts(const std::string&, Index, Offset, std::uint64_t);
template double worst_residual(const ContactBatch<float>&, const std::vector<float>&);
template double worst_residual(const ContactBatch<double>&, const std::vector<double>&);
template std::string hash_text(const std::vector<float>&);
template std::string hash_text(const std::vector<double>&);

}  // namespace stiction::bench
