#include "distributed/world/rank_world.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/job/shape_pairs.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/solve/rank_meter.hpp"
#include "distributed/solve/solve_piece.hpp"
#include "distributed/world/plan_piece.hpp"
#include "distributed/world/world_kernels.hpp"

namespace stiction::distributed {

namespace {

/// Steps after which space may be cut anew, and the share of its bodies that a rank has to have too many then. They
/// reach messages, and no bit.
constexpr std::int64_t kCutEvery = 8;
constexpr Offset kTooMany = 8;

/// Adds time and traffic between its birth and its death.
class Meter {
 public:
  Meter(const Transport& transport, StepTraffic& traffic, double& seconds)
      : meter_(transport), traffic_(traffic), seconds_(seconds) {}
  ~Meter() {
    meter_.add_messages_to(traffic_);
    seconds_ += meter_.seconds();
  }
  Meter(const Meter&) = delete;
  Meter& operator=(const Meter&) = delete;

 private:
  RankMeter meter_;
  StepTraffic& traffic_;
  double& seconds_;
};

template <class Real>
std::uint64_t digest_of(const WorldModelView<Real>& model, const WorldOptions& options,
                        const std::optional<std::uint64_t>& random) {
  Digest digest;
  for (Index body = 0; body < model.bodies; ++body) {
    const WorldBodyData<Real>& data = model.body[body];
    digest.add(&data.inv_mass, 1);
    digest.add(data.inv_inertia, 3);
  }
  for (Index k = 0; k < model.shapes; ++k) {
    const WorldShapeData<Real>& shape = model.shape[k];
    digest.add(static_cast<std::uint64_t>(shape.body));
    digest.add(static_cast<std::uint64_t>(shape.kind));
    for (const Real* three : {shape.size, shape.position}) digest.add(three, 3);
    digest.add(shape.axes, 9);
    digest.add(&shape.mu, 1);
    digest.add(&shape.restitution, 1);
  }
  digest.add(model.gravity, 3);
  const double numbers[] = {options.margin, options.warm_start};
  digest.add(numbers, 2);
  digest.add(random ? *random + 1 : 0);
  add_options(digest, options.stepping, options.solver);
  return digest.sum();
}

template <class Real>
Point centre_of(const BodyNumbers<Real>& numbers) {
  return {static_cast<double>(numbers.position[0]), static_cast<double>(numbers.position[1]),
          static_cast<double>(numbers.position[2])};
}

}  // namespace

template <class Real>
RankWorld<Real>::RankWorld(Transport& transport, const WorldModelView<Real>& whole, const WorldOptions& options,
                           std::optional<std::uint64_t> random)
    : transport_(transport), whole_(whole), options_(options), random_(random) {
  check_world_options(options);
  require_impulses(options.solver);
  BodySolverOptions alone = options.solver;
  alone.threads = 1;
  static_cast<void>(BodySolver(Device::cpu(), options.stepping, alone));  // refuses values out of range
  require_agreement(transport, digest_of(whole, options, random), "another scene, other options or other owners");
  take({}, {});
}

template <class Real>
BodyRange RankWorld<Real>::first_share() const {
  return share_of(whole_.bodies, transport_.rank(), transport_.size());
}

template <class Real>
void RankWorld<Real>::put(BodyList<Real> bodies, Impulses<Real> last) {
  for (const std::uint64_t id : last.id)
    if (!has_pair(id))
      throw Error(ErrorCode::invalid_argument,
                  "contact_id = " + std::to_string(id) + ": the scene has " + std::to_string(pair_count(whole_)) +
                      " pairs of shapes, and none of that id; go on from a checkpoint of this scene");
  take(std::move(bodies), sorted(last));
  steps_ = 0;
  is_uneven_ = false;
  status_ = {};
  piece_.reset();
  cut_space();
  share_out();
  step_traffic_.migrated = 0;
}

template <class Real>
void RankWorld<Real>::take(BodyList<Real> bodies, Impulses<Real> last) {
  own_ = std::move(bodies);
  last_ = std::move(last);
  part_ = std::make_unique<PartOfWorld<Real>>(whole_, own_);
}

template <class Real>
void RankWorld<Real>::cut_space() {
  if (random_) return;
  std::vector<Point> points;
  for (const BodyNumbers<Real>& numbers : own_.numbers) points.push_back(centre_of(numbers));
  cuts_ = Cuts(transport_, own_.body, points);
}

template <class Real>
int RankWorld<Real>::owner_of(std::size_t k) const {
  return random_ ? random_owner(own_.body[k], transport_.size(), *random_)
                 : cuts_.owner(own_.body[k], centre_of(own_.numbers[k]));
}

template <class Real>
bool RankWorld<Real>::has_pair(std::uint64_t contact_id) const {
  return contact_id / kFeatures < static_cast<std::uint64_t>(pair_count(whole_));
}

template <class Real>
ShapePair RankWorld<Real>::pair_of(std::uint64_t contact_id) const {
  return numbered_pair(whole_, static_cast<Offset>(contact_id / kFeatures));
}

/// Bodies that are in another rank's cell go there, with their contacts' final impulses.
template <class Real>
void RankWorld<Real>::share_out() {
  const auto ranks = static_cast<std::size_t>(transport_.size());
  std::vector<int> owner(own_.size());
  std::vector<std::uint32_t> leaving(ranks, 0);
  for (std::size_t k = 0; k < own_.size(); ++k) {
    owner[k] = owner_of(k);
    if (owner[k] != transport_.rank()) ++leaving[static_cast<std::size_t>(owner[k])];
  }
  std::vector<Letter> letters(ranks);
  for (std::size_t rank = 0; rank < ranks; ++rank)
    if (leaving[rank] > 0) letters[rank].put(leaving[rank]);
  BodyList<Real> bodies;
  for (std::size_t k = 0; k < own_.size(); ++k) {
    if (owner[k] == transport_.rank()) {
      bodies.add(own_.body[k], own_.numbers[k]);
      continue;
    }
    Letter& letter = letters[static_cast<std::size_t>(owner[k])];
    letter.put(own_.body[k]);
    letter.put(own_.numbers[k]);
  }
  const bool any_leave = bodies.size() != own_.size();
  for (std::size_t c = 0; any_leave && c < last_.id.size(); ++c) {
    const ShapePair pair = pair_of(last_.id[c]);
    int told = transport_.rank();
    for (const Index body : {pair.body_a, pair.body_b}) {
      const auto found = std::lower_bound(own_.body.begin(), own_.body.end(), body);
      if (found == own_.body.end() || *found != body) continue;
      const int to = owner[static_cast<std::size_t>(found - own_.body.begin())];
      if (to == transport_.rank() || to == told) continue;
      told = to;
      Letter& letter = letters[static_cast<std::size_t>(to)];
      letter.put(last_.id[c]);
      for (std::size_t j = 0; j < 3; ++j) letter.put(last_.impulse[3 * c + j]);
    }
  }
  letters = exchange_with_all(transport_, letters);
  Impulses<Real> last = last_;
  const std::size_t stayed = bodies.size();
  for (Letter& letter : letters) {
    if (letter.at_end()) continue;
    for (auto count = letter.template take<std::uint32_t>(); count > 0; --count) {
      const auto body = letter.template take<Index>();
      bodies.add(body, letter.template take<BodyNumbers<Real>>());
    }
    while (!letter.at_end()) {
      last.id.push_back(letter.template take<std::uint64_t>());
      for (std::size_t j = 0; j < 3; ++j) last.impulse.push_back(letter.template take<Real>());
    }
  }
  step_traffic_.migrated += static_cast<std::int64_t>(bodies.size() - stayed);
  if (any_leave || bodies.size() != stayed) take(sorted(bodies), sorted(last));
}

template <class Real>
void RankWorld<Real>::step() {
  const ScopedFpEnv fp_env;
  {
    const Meter meter(transport_, step_traffic_, step_traffic_.seconds.detect);
    if (is_uneven_ && steps_ % kCutEvery == 0) cut_space();
    share_out();
    const NearBodies<Real> near = find_near_bodies(transport_, own_, *part_);
    is_uneven_ = (near.most_bodies * transport_.size() - near.all_bodies) * kTooMany > near.all_bodies;
    step_traffic_.near_bodies = static_cast<std::int64_t>(near.list.size());
    piece_ = std::make_unique<StepPiece<Real>>(whole_, near, transport_.rank(), last_,
                                               static_cast<Real>(options_.warm_start));
  }
  ++steps_;
  solve();
}

template <class Real>
void RankWorld<Real>::solve() {
  const BodyBatchView<Real> batch = piece_->batch();
  HostContacts<Real>& contacts = piece_->contacts();
  PiecePlan plan;
  {
    const Meter meter(transport_, step_traffic_, step_traffic_.seconds.plan);
    plan = plan_piece(transport_, batch, piece_->bodies(), step_traffic_.waves);
  }
  std::vector<Real> twist(at(6 * batch.body_count));
  BodySolverOptions isolating = options_.solver;
  isolating.invalid = InvalidPolicy::isolate;
  const BodyJob<Real> job{batch,
                          plan.plan.view(),
                          {contacts.impulse.data(), twist.data(), nullptr, &status_},
                          options_.warm_start > 0 ? contacts.guess.data() : nullptr,
                          options_.stepping,
                          isolating};
  report_.bodies = report_.ghosts = 0;  // of the last step
  solve_piece(transport_, job, plan.rounds, piece_->ghosts(), report_);
  last_ = {contacts.id, contacts.impulse};
  integrate(twist);
}

template <class Real>
void RankWorld<Real>::integrate(const std::vector<Real>& twist) {
  const auto start = std::chrono::steady_clock::now();
  WorldArrays<Real>& arrays = part_->arrays();
  const PieceBodies& bodies = piece_->bodies();
  auto to = arrays.solved_twist.begin();
  for (std::size_t k = 0; k < bodies.body.size(); ++k)
    if (bodies.owner[k] == bodies.rank) to = std::copy_n(twist.begin() + static_cast<std::ptrdiff_t>(6 * k), 6, to);
  arrays.status.front() = status_;
  world_kernels<Real>().integrate(arrays.job(), 0);
  for (std::size_t k = 0; k < own_.size(); ++k) own_.numbers[k] = part_->numbers(k);
  step_traffic_.seconds.integrate += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

template <class Real>
WorldMotion RankWorld<Real>::motion() const {
  const ScopedFpEnv fp_env;
  return world_kernels<Real>().motion(part_->arrays().job(), 0);
}

template class RankWorld<float>;
template class RankWorld<double>;

}  // namespace stiction::distributed
