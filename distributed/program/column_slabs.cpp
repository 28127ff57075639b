#include "distributed/program/column_slabs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "cli/body_method.hpp"
#include "cli/stopwatch.hpp"
#include "distributed/program/column.hpp"
#include "distributed/program/peak_memory.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/transport/letters.hpp"
#include "distributed/world/bodies.hpp"
#include "distributed/world/solve_part.hpp"
#include "scenes/body_scenes.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

void require_slabs(const SolveArguments& arguments) {
  const auto refuse = [](const std::string& what, const char* remedy) {
    throw Error(ErrorCode::unsupported, fmt::format("--partition slabs: {}; {}", what, remedy));
  };
  if (arguments.scene != kColumn)
    refuse(fmt::format("no rank makes a part of anything but scene {}", kColumn), "choose bisection");
  if (!cli::is_sweeping(arguments.method))
    refuse(fmt::format("method {} needs lists of the whole scene", arguments.method),
           "choose --method si, or bisection");
  if (arguments.output || arguments.warm_start)
    refuse("no rank has the whole solution", "leave out -o and --warm-start, or choose bisection");
}

/// Share of a hash and of counts that one rank has.
struct Share {
  std::int64_t walls = 0, pairs = 0;  ///< contacts that are this rank's to answer for
};

/// The slab of one environment.
template <class Real>
class Slab {
 public:
  Slab(Transport& transport, const ColumnScene& scene, std::uint64_t seed) : transport_(transport) {
    const auto all = static_cast<Index>(scenes::column_bodies(scene.side, scene.layers));
    const BodyRange own = share_of(all, transport.rank(), transport.size());
    scenes::BodyPart part = scenes::make_body_column_part(seed, scene.side, scene.layers, own.first, own.end);
    if constexpr (std::is_same_v<Real, double>) {
      batch_.add(part.environment);
    } else {
      batch_.add(scenes::rounded(part.environment));
    }
    walls_ = part.walls;
    pairs_below_ = part.pairs_below;
    bodies_.rank = transport.rank();
    bodies_.body = std::move(part.body);
    for (const Index body : bodies_.body) bodies_.owner.push_back(rank_with(body, all, transport.size()));
  }

  EnvStatus solve(const ColumnScene& scene, const BodySolverOptions& options, RankReport& report) {
    const BodyBatchView<Real> view = batch_.view();
    impulse_.resize(at(3 * view.contact_count));
    return solve_part(transport_, view, bodies_, scene.stepping, options, impulse_.data(), report);
  }

  /// Returns the shares of all ranks.
  [[nodiscard]] std::vector<Share> shares() const {
    return gather(transport_, Share{walls_, batch_.contact_count() - walls_ - pairs_below_});
  }

  /// Returns this rank's part of the hash of all impulses, whose environment begins at that contact.
  [[nodiscard]] std::uint64_t hash(const std::vector<Share>& shares, Offset first) const {
    Offset walls_before = first, pairs_before = first;
    for (std::size_t rank = 0; rank < shares.size(); ++rank) {
      const bool is_before = static_cast<int>(rank) < bodies_.rank;
      if (is_before) walls_before += shares[rank].walls;
      pairs_before += shares[rank].walls + (is_before ? shares[rank].pairs : 0);
    }
    const std::span<const Real> all(impulse_);
    return hash_part(all.first(at(3 * walls_)), static_cast<std::uint64_t>(3 * walls_before)) +
           hash_part(all.subspan(at(3 * (walls_ + pairs_below_))), static_cast<std::uint64_t>(3 * pairs_before));
  }

 private:
  Transport& transport_;
  BodyBatch<Real> batch_;
  PieceBodies bodies_;
  std::vector<Real> impulse_;
  Offset walls_ = 0, pairs_below_ = 0;
};

}  // namespace

template <class Real>
int solve_column_slabs(Transport& transport, const SolveArguments& arguments, BodySolverOptions options,
                       JobReport& report) {
  require_slabs(arguments);
  const ColumnScene scene = column_scene(arguments);
  options.law = scene.law;
  Digest digest;
  const std::uint64_t words[] = {arguments.seed, static_cast<std::uint64_t>(arguments.environments),
                                 static_cast<std::uint64_t>(scene.side)};
  digest.add(words, 3);
  require_agreement(transport, digest.sum(), "another scene");
  cli::SolveReport& solve = report.solve;
  std::vector<EnvStatus> status;
  RankReport own;
  std::uint64_t hash = 0;
  for (std::int64_t env = 0; env < arguments.environments; ++env) {
    const cli::Clock::time_point start = cli::Clock::now();
    Slab<Real> slab(transport, scene, column_seed(arguments, env));
    solve.seconds.load += cli::seconds_since(start);
    status.push_back(slab.solve(scene, options, own));
    const std::vector<Share> shares = slab.shares();
    hash += slab.hash(shares, solve.cones);
    for (const Share& share : shares) solve.cones += share.walls + share.pairs;
    report.bodies += scenes::column_bodies(scene.side, scene.layers);
  }
  report.ranks = gather(transport, own);
  report.peak_memory = gather(transport, peak_memory());
  for (const RankReport& rank : report.ranks) solve.seconds.solve = std::max(solve.seconds.solve, rank.seconds);
  solve.law = scene.law;
  solve.environments = arguments.environments;
  solve.rows = 3 * solve.cones;
  solve.count(status);
  for (const std::uint64_t part : gather(transport, hash)) solve.hash += part;
  return solve.unconverged == 0 ? cli::kExitDone : cli::kExitMissed;
}

template int solve_column_slabs<float>(Transport&, const SolveArguments&, BodySolverOptions, JobReport&);
template int solve_column_slabs<double>(Transport&, const SolveArguments&, BodySolverOptions, JobReport&);

}  // namespace stiction::distributed
