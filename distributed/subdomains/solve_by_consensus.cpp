#include "distributed/subdomains/solve_by_consensus.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/plan/body_plan.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/solve/rank_meter.hpp"
#include "distributed/subdomains/one_env.hpp"
#include "distributed/subdomains/region.hpp"
#include "distributed/subdomains/round_letters.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

void require_options(const ConsensusOptions& consensus, const BodySolverOptions& options) {
  const auto refuse = [](const std::string& message) { throw Error(ErrorCode::invalid_argument, message); };
  if (consensus.subdomains < 1)
    refuse("subdomains = " + std::to_string(consensus.subdomains) + ": expected one or more");
  if (consensus.sweeps < 1) refuse("sweeps = " + std::to_string(consensus.sweeps) + ": expected one or more");
  if (!(consensus.penalty > 0) || consensus.penalty > 0x1p20)
    refuse("penalty = " + std::to_string(consensus.penalty) + ": expected a number above 0, up to 2^20");
  if (options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported, "method: subdomains are solved by BodyMethod::impulses alone; choose it");
  if (options.max_contacts_per_env != 0 || options.substeps != 1)
    throw Error(ErrorCode::unsupported, "max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) +
                                            ", substeps = " + std::to_string(options.substeps) +
                                            ": consensus solves all contacts in one step; use 0 and 1");
  if (consensus.asynchronous && contact_law(options) != Law::convex)
    throw Error(ErrorCode::unsupported,
                std::string("asynchronous: rounds that do not wait converge for convex problems alone, and these "
                            "contacts obey ") +
                    (options.box_friction ? "boxed friction" : "Coulomb's law") +
                    "; choose --law convex, or leave out --asynchronous");
}

BodySolverOptions with_iterations(BodySolverOptions options, Index iterations, double tolerance) {
  options.iterations = iterations;
  options.tolerance = tolerance;
  options.threads = 1;
  return options;
}

/// Numbers that ranks decide by, one after another in the same round: the residual, and how far copies are apart.
struct Assessment {
  double residual = 0;  ///< absolute [w]
  ConsensusGap gap;
  Index sweeps = 0;  ///< the most that a rank has made
  bool is_broken = false, has_moved = false;
};

/// One environment by the subdomains of this rank.
template <class Real>
class ConsensusOfEnv {
 public:
  ConsensusOfEnv(Transport& transport, const OneEnv<Real>& env, std::span<const int> part,
                 const ConsensusOptions& consensus, const TimeStepping& stepping, const BodySolverOptions& options)
      : transport_(transport),
        env_(env),
        consensus_(consensus),
        options_(options),
        parts_(make_subdomains(env.view, part, consensus.subdomains)),
        judge_(Device::cpu(), stepping, with_iterations(options, 0, options.tolerance)),
        stepping_(stepping),
        sweeps_a_round_(consensus.sweeps),
        penalty_(consensus.penalty),
        local_(local_solver(consensus.sweeps)),
        judge_plan_(judge_.plan(env.view)),
        answer_(at(3 * env.view.contact_count)) {
    const EnvStatus start = verdict(env.warm_start);
    is_refused_ = start.code == EnvCode::invalid_input;
    flags_ = start.flags;
    const bool is_cold = (start.flags & kFlagWarmStartRejected) != 0;
    region_.emplace(env.view, parts_, transport.rank(), transport.size(), stepping, options,
                    is_cold ? nullptr : env.warm_start);
  }

  void solve(RankReport& report) {
    if (is_refused_) return publish(report);
    plan_.emplace(local_.plan(region_->batch()));
    region_->use_plan(plan_->data().view());
    best_impulses_.assign(at(3 * region_->contacts()), Real(0));
    halo_.emplace(transport_, region_->rounds());
    {
      const RankMeter meter(transport_);
      scale_ = largest_of_ranks(region_->scale());
      region_->set_penalty(penalty_, 1.0);
      if (consensus_.asynchronous) {
        iterate_asynchronously();
      } else {
        iterate();
      }
      meter.add_to(report);
      report.rounds += rounds_;
    }
    publish(report);
  }

 private:
  /// Solver of each subdomain: whatever a round's numbers are, it ends.
  [[nodiscard]] BodySolver local_solver(Index sweeps) const {
    BodySolverOptions local = with_iterations(options_, sweeps, 0);
    local.invalid = InvalidPolicy::isolate;
    return {Device::cpu(), stepping_, local};
  }

  void iterate() {
    for (;;) {
      if ((rounds_ % kConsensusRounds == 0 || !has_room_for(1, sweeps_)) && conclude(1)) return;
      make_round(kConsensusRelaxation);
      halo_->share(0, region_->told(), 6);
      region_->meet();
    }
  }

  /// Rounds as above, each from the newest letters. Once every rank has made some, all meet to decide.
  void iterate_asynchronously() {
    RoundLetters letters(transport_, region_->rounds().front());
    while (!conclude(kConsensusRounds)) {
      region_->restore_asked(factor_);
      make_rounds(letters);
      halo_->share(0, region_->told(), 6);
      region_->meet_again();
    }
    letters.finish();
  }

  /// Rounds until all ranks have made some.
  void make_rounds(RoundLetters& letters) {
    letters.begin();
    for (Index made = 0;;) {
      letters.take(region_->told());
      if (made >= kConsensusRounds && letters.all_are_ready()) return;
      if (made >= kAsynchronousRounds || !has_room_for(1, sweeps_)) {
        letters.await(region_->told());
        continue;
      }
      region_->meet();
      make_round(kAsynchronousRelaxation);
      letters.send(++made, region_->told());
    }
  }

  /// Sweeps the subdomains here from where copies have met.
  void make_round(double relaxation) {
    region_->pull(penalty_);
    local_.solve(*plan_, region_->batch(), region_->solution(), region_->first_guess());
    region_->ask(relaxation);
    ++rounds_;
    sweeps_ += sweeps_a_round_;
    if (consensus_.after_sweeps) consensus_.after_sweeps();
  }

  [[nodiscard]] bool has_room_for(Offset rounds, Index sweeps) const {
    return rounds * sweeps_a_round_ <= options_.iterations - sweeps;
  }

  /// Meeting of all ranks, `rounds` after the last: returns true if that was the end, as it is without room for as
  /// many more. If not, how the next ones are made.
  bool conclude(Offset rounds) {
    const Assessment now = assess();
    most_sweeps_ = now.sweeps;
    const bool is_last = !has_room_for(rounds, most_sweeps_);
    if (now.is_broken) end_as_ = EnvCode::numerical;
    if (keep_best(now) || now.is_broken || is_last) return true;
    // z has moved for as many rounds as ranks have made since they last met, and copies are apart after one.
    factor_ = penalty_factor(gap_of_one_round(now.gap, static_cast<double>(rounds)), penalty_);
    penalty_ = factor_ * penalty_;
    if (factor_ != 1.0) region_->set_penalty(penalty_, factor_);
    if (now.has_moved) return false;
    // A solver returns the best iterate that it has seen, which may be its first guess however often it is asked.
    if (sweeps_a_round_ > (options_.iterations - most_sweeps_) / 2) return true;
    local_ = local_solver(sweeps_a_round_ *= 2);
    return false;
  }

  /// Keeps the impulses if they are the best so far. Returns true if a judge finds that they are the answer.
  bool keep_best(const Assessment& now) {
    if (!(now.residual < best_)) return false;
    best_ = now.residual;
    best_impulses_ = region_->impulses();
    // An estimate of the same numbers: it may differ from the verdict by a rounding, and so is held against it once.
    if (!(best_ <= options_.tolerance * scale_) || best_ > 0.5 * refused_at_) return false;
    refused_at_ = best_;
    collect();
    std::uint8_t is_solved = 0;
    if (transport_.rank() == 0) is_solved = verdict(answer_.data()).code == EnvCode::solved ? 1 : 0;
    return gather(transport_, is_solved).front() != 0;
  }

  Assessment assess() {
    region_->tell_changes();
    halo_->share(0, region_->told(), 6);
    const LargestResidual<double> own = region_->judge();
    // Two numbers of each subdomain, those of other ranks' zero, then the rank's own.
    const std::size_t width = 2 * at(parts_.count()) + 4;
    std::vector<double> mine(width);
    for (std::size_t k = 0; k < region_->gaps().size(); ++k) {
      const std::size_t subdomain = at(region_->first()) + k;
      mine[2 * subdomain] = region_->gaps()[k].primal;
      mine[2 * subdomain + 1] = region_->gaps()[k].dual;
    }
    mine[width - 4] = sweeps_;
    mine[width - 3] = region_->has_moved() ? 1 : 0;
    mine[width - 2] = own.square;
    mine[width - 1] = region_->is_broken() ? 1 : 0;
    const std::byte* bytes = halo_->gather(mine.data(), width * sizeof(double));
    const auto all = [&](int rank, std::size_t k) {
      double number;
      std::memcpy(&number, bytes + (at(rank) * width + k) * sizeof(double), sizeof(double));
      return number;
    };
    Assessment made;
    LargestResidual<double> largest;
    for (int rank = 0; rank < transport_.size(); ++rank) {
      largest.square = max_(all(rank, width - 2), largest.square);
      made.sweeps = std::max(made.sweeps, static_cast<Index>(all(rank, width - 4)));
      made.has_moved = made.has_moved || all(rank, width - 3) != 0;
      made.is_broken = made.is_broken || all(rank, width - 1) != 0 || !finite_(all(rank, width - 2));
    }
    for (int subdomain = 0; subdomain < parts_.count(); ++subdomain) {
      const int rank = parts_.rank_of(subdomain, transport_.size());
      add_gap(made.gap, {all(rank, 2 * at(subdomain)), all(rank, 2 * at(subdomain) + 1)});
    }
    made.residual = final_residual_of(largest, ErrorScale{}).residual;
    return made;
  }

  double largest_of_ranks(double mine) {
    double largest = 1e-300;
    for (const double one : gather(transport_, mine)) largest = max_(one, largest);
    return largest;
  }

  /// The best impulses of all subdomains, by contact, into the answer of rank 0.
  void collect() {
    const auto size_of = [&](int rank) {
      std::size_t size = 0;
      for_each_contact(rank, [&](Index) { size += 3; });
      return size;
    };
    if (transport_.rank() != 0) {
      const Outgoing out{0, std::as_bytes(std::span(best_impulses_))};
      if (!best_impulses_.empty()) transport_.exchange({&out, 1}, {});
      return;
    }
    std::vector<std::vector<Real>> all(at(transport_.size()));
    std::vector<Incoming> in;
    for (int rank = 1; rank < transport_.size(); ++rank) {
      all[at(rank)].resize(size_of(rank));
      if (!all[at(rank)].empty()) in.push_back({rank, std::as_writable_bytes(std::span(all[at(rank)]))});
    }
    if (!in.empty()) transport_.exchange({}, in);
    all.front() = best_impulses_;
    for (int rank = 0; rank < transport_.size(); ++rank) {
      const Real* next = all[at(rank)].data();
      for_each_contact(rank, [&](Index contact) {
        std::copy_n(next, 3, answer_.data() + 3 * static_cast<Offset>(contact));
        next += 3;
      });
    }
  }

  template <class F>
  void for_each_contact(int rank, F&& f) const {
    for (int subdomain = 0; subdomain < parts_.count(); ++subdomain)
      if (parts_.rank_of(subdomain, transport_.size()) == rank)
        for (const Index contact : parts_.contacts[at(subdomain)]) f(contact);
  }

  /// Returns the verdict of a solver without sweeps on those impulses, which stays in judged_.
  EnvStatus verdict(const Real* impulses) {
    judged_.impulse.resize(at(3 * env_.view.contact_count));
    judged_.w.resize(judged_.impulse.size());
    judged_.twist.resize(at(6 * env_.view.body_count));
    judged_.status.resize(1);
    judge_.solve(
        judge_plan_, env_.view,
        BodySolutionView<Real>{judged_.impulse.data(), judged_.twist.data(), judged_.w.data(), judged_.status.data()},
        impulses);
    return judged_.status.front();
  }

  void publish(RankReport& report) {
    report.bodies += region_->bodies();
    report.ghosts += region_->ghosts();
    report.contacts += region_->contacts();
    if (!is_refused_) {
      collect();
      if (transport_.rank() == 0) verdict(answer_.data());
    }
    if (transport_.rank() != 0) return;
    EnvStatus& status = judged_.status.front();
    if (status.code == EnvCode::max_iterations) status.code = end_as_;
    status.flags |= flags_;
    status.iterations = most_sweeps_;
    const BodySolutionView<Real>& out = env_.solution;
    std::copy(judged_.impulse.begin(), judged_.impulse.end(), out.impulse);
    std::copy(judged_.twist.begin(), judged_.twist.end(), out.twist);
    if (out.w != nullptr) std::copy(judged_.w.begin(), judged_.w.end(), out.w);
    *out.status = status;
  }

  Transport& transport_;
  const OneEnv<Real>& env_;
  ConsensusOptions consensus_;
  BodySolverOptions options_;
  Subdomains parts_;
  BodySolver judge_;
  TimeStepping stepping_;
  Index sweeps_a_round_;
  double penalty_, factor_ = 1;  ///< last factor of the penalty
  BodySolver local_;
  BodyPlan judge_plan_;
  std::optional<BodyPlan> plan_;
  std::optional<Region<Real>> region_;
  std::optional<Halo> halo_;
  BodySolution<Real> judged_;
  std::vector<Real> answer_, best_impulses_;
  bool is_refused_ = false;
  std::uint32_t flags_ = 0;
  EnvCode end_as_ = EnvCode::max_iterations;
  double scale_ = 0, best_ = __builtin_huge_val(), refused_at_ = __builtin_huge_val();
  Index rounds_ = 0, sweeps_ = 0;  ///< of this rank
  Index most_sweeps_ = 0;          ///< of any rank, when all last met
};

}  // namespace

template <class Real>
std::vector<RankReport> solve_by_consensus(Transport& transport, const BodyBatchView<Real>& batch,
                                           std::span<const int> part, const ConsensusOptions& consensus,
                                           const TimeStepping& stepping, const BodySolverOptions& options,
                                           const BodySolutionView<Real>& solution, const Real* warm_start) {
  const ScopedFpEnv fp_env;
  require_options(consensus, options);
  const BodySolver solver(Device::cpu(), stepping, with_iterations(options, options.iterations, options.tolerance));
  if (transport.rank() == 0) solver.check(solver.plan(batch), batch, solution);
  require_owners("part", "subdomain", part, batch.body_count, consensus.subdomains);
  Digest digest;
  digest.add(digest_of(batch, part, stepping, options, warm_start));
  digest.add(static_cast<std::uint64_t>(consensus.subdomains));
  digest.add(static_cast<std::uint64_t>(consensus.sweeps));
  digest.add(&consensus.penalty, 1);
  digest.add(std::uint64_t{consensus.asynchronous ? 1U : 0U});
  require_agreement(transport, digest.sum(), "another batch, other options or other subdomains");
  RankReport report;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first = batch.env_body_offsets[env];
    const OneEnv<Real> one(batch, solution, warm_start, env);
    ConsensusOfEnv<Real> own(transport, one, part.subspan(at(first), at(one.view.body_count)), consensus, stepping,
                             options);
    own.solve(report);
  }
  return gather(transport, report);
}

template std::vector<RankReport> solve_by_consensus(Transport&, const BodyBatchView<float>&, std::span<const int>,
                                                    const ConsensusOptions&, const TimeStepping&,
                                                    const BodySolverOptions&, const BodySolutionView<float>&,
                                                    const float*);
template std::vector<RankReport> solve_by_consensus(Transport&, const BodyBatchView<double>&, std::span<const int>,
                                                    const ConsensusOptions&, const TimeStepping&,
                                                    const BodySolverOptions&, const BodySolutionView<double>&,
                                                    const double*);

}  // namespace stiction::distributed
