#include "distributed/newton/solve_by_newton.hpp"

#include <algorithm>
#include <optional>
#include <string>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/plan/body_plan.hpp"
#include "distributed/newton/domain_space.hpp"
#include "distributed/newton/env_judge.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/solve/rank_meter.hpp"

namespace stiction::distributed {

namespace {

void require_newton(const DomainOptions& domains, const BodySolverOptions& options) {
  if (domains.count < 1)
    throw Error(ErrorCode::invalid_argument,
                "domains.count = " + std::to_string(domains.count) + ": expected one or more");
  if (domains.sweeps < 1)
    throw Error(ErrorCode::invalid_argument,
                "domains.sweeps = " + std::to_string(domains.sweeps) + ": expected one or more");
  if (options.method != BodyMethod::newton)
    throw Error(ErrorCode::unsupported, "method: this is Newton's; choose BodyMethod::newton, or solve_over_ranks()");
  if (options.max_contacts_per_env != 0 || options.substeps != 1)
    throw Error(ErrorCode::unsupported,
                "max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) +
                    ", substeps = " + std::to_string(options.substeps) +
                    ": Newton's method over ranks solves all contacts in one step; use 0 and 1");
}

/// Planning as Newton's method needs it, without a preconditioner's own integers.
BodySolverOptions for_planning(BodySolverOptions options) {
  options.space.preconditioner = BodyPreconditioner::block_diagonal;
  options.threads = 1;
  return options;
}

/// One environment by the subdomains of this rank.
template <class Real>
class NewtonOfEnv {
 public:
  NewtonOfEnv(Transport& transport, const OneEnv<Real>& env, std::span<const int> part, std::span<const int> home,
              const DomainOptions& domains, const TimeStepping& stepping, const BodySolverOptions& options)
      : transport_(transport),
        one_(env),
        home_(home),
        stepping_(stepping),
        options_(options),
        params_(si_params(stepping, options)),
        judge_(env, stepping, options),
        best_impulse_(at(3 * env.view.contact_count), Real(0)) {
    const EnvStatus start = judge_.verdict(env.warm_start);
    is_refused_ = start.code == EnvCode::invalid_input;
    flags_ = start.flags;
    sequence.sweeps = domains.sweeps;
    if (is_refused_) return;
    if (env.warm_start != nullptr && (flags_ & kFlagWarmStartRejected) == 0)
      std::copy_n(env.warm_start, best_impulse_.size(), best_impulse_.begin());
    plan_.emplace(BodySolver(Device::cpu(), stepping, for_planning(options)).plan(env.view));
    env_ = slice_bodies(BodyJob<Real>{env.view, plan_->data().view(), {}, nullptr, stepping, options}, 0);
    points_ = centres_by_arms(env.view);
    const NewtonStream stream = take_newton_stream(env_.newton_stream);
    domains_ = make_domains(stream.pattern, env_.sides, env_.kept, part, points_, domains);
    reach_ = make_reach(stream, domains_, home, transport.rank(), transport.size());
    space_.emplace(transport, env_, params_, options.law, domains_, reach_, home, points_, options.space.ordering);
    impulse_ = best_impulse_;
    for (const int domain : part) owner_.push_back(home[at(domain)]);
    twist_.resize(at(6 * env.view.body_count));
    for (Index body = 0; body < env_.bodies; ++body) free_twist(body, twist_of(body));
  }

  void solve(RankReport& report, NewtonCounts& counts) {
    NewtonEnd end = NewtonEnd::solved;
    if (!is_refused_) {
      const RankMeter meter(transport_);
      scale_ = error_scale(options_.law == Law::convex ? largest_error_at_rest<Law::convex>(env_, params_, 0.0)
                                                       : largest_error_at_rest<Law::coulomb>(env_, params_, 0.0));
      scale_.unit = 1.0;
      sequence.least_weight = space_->least_weight();
      end = stiction::solve_by_newton(*this, steps_, options_.iterations);
      meter.add_to(report);
      report.bodies += static_cast<Offset>(reach_.seen.size());
      report.ghosts += static_cast<Offset>(reach_.seen.size());
      for (const int domain : reach_.domains) report.ghosts -= static_cast<Offset>(domains_.bodies[at(domain)].size());
      report.contacts += static_cast<Offset>(reach_.contacts.size());
      counts.steps += steps_;
      counts.sweeps += sweeps_;
      counts.linear_steps += space_->linear_steps();
    }
    publish(end);
  }

  // Functions that solve_by_newton() of core/algorithm/newton calls.
  NewtonSequence sequence{};
  double start() {
    const double residual = judge();
    ask_judge();
    return residual;
  }
  bool sweeps_first() const { return true; }
  bool step() { return space_->take_step(sequence); }
  NewtonResidual evaluate() {
    const double problem = space_->renew_reactions();
    store_reactions();
    const double iterate = judge();
    ask_judge();
    return {iterate, problem};
  }
  bool is_solved() const { return is_solved_; }
  bool has_sequence() const { return options_.law == Law::coulomb || sequence.prox_weight > 0.0; }
  bool can_sweep() const { return options_.law == Law::coulomb; }
  /// Sequential impulses over ranks.
  void sweep() {
    share_best(true);
    BodySolverOptions sweeping = options_;
    sweeping.method = BodyMethod::impulses;
    sweeping.iterations = sequence.sweeps;
    BodySolution<Real> swept;
    BodySolutionView<Real> view;
    if (transport_.rank() == 0) {
      swept.impulse.resize(impulse_.size());
      swept.twist.resize(at(6 * one_.view.body_count));
      swept.status.resize(1);
      view = {swept.impulse.data(), swept.twist.data(), nullptr, swept.status.data()};
    }
    solve_over_ranks(transport_, one_.view, std::span<const int>(owner_), stepping_, sweeping, view,
                     static_cast<const Real*>(best_impulse_.data()));
    const Index made = transport_.rank() == 0 ? swept.status.front().iterations : 0;
    sweeps_ += gather(transport_, made).front();
    std::vector<Letter> out(at(transport_.size()));
    if (transport_.rank() == 0) {
      impulse_ = swept.impulse;
      for (std::size_t rank = 1; rank < out.size(); ++rank)
        for (const Real number : impulse_) out[rank].put(number);
    }
    std::vector<Letter> in = exchange_with_all(transport_, out);
    if (transport_.rank() != 0)
      for (Real& number : impulse_) number = in.front().template take<Real>();
    const double before = sequence.best;
    judge();
    if (sequence.best < before) best_impulse_ = impulse_;
    sequence.double_sweeps();
    space_->start(env_, best_impulse_.data(), sequence);
    space_->renew_reactions();
    ask_judge();
  }
  void renew() {
    space_->renew_problem(sequence);
    space_->renew_reactions();
  }

 private:
  void free_twist(Index body, double* twist) const {
    double change[6];
    free_twist_of(env_, body, change, twist);
  }
  double* twist_of(Index body) { return twist_.data() + 6 * static_cast<Offset>(body); }

  void store_reactions() {
    for (const Index p : reach_.contacts)
      for (Index k = 0; k < 3; ++k)
        impulse_[at(3 * Offset{env_.contact_order[p]} + k)] =
            canonical_zero(static_cast<Real>(space_->contact(p).reaction[k]));
  }

  /// The residual of the impulses [w]; if it is the best, they are kept.
  double judge() {
    for (const Index row : reach_.rows) {
      if (env_.is_kinematic(row)) continue;
      double change[6], free[6];
      pushed_change(env_, row, impulse_.data(), change);
      free_twist(row, free);
      sum_changes(change, 1, free, twist_of(row));
    }
    LargestResidual<double> largest;
    for (const int domain : reach_.domains)
      for (const Index p : domains_.contacts[at(domain)]) {
        if (options_.law == Law::convex)
          judge_contact<Law::convex>(env_, params_, p, impulse_.data(), twist_.data(), 1.0, largest);
        else
          judge_contact<Law::coulomb>(env_, params_, p, impulse_.data(), twist_.data(), 1.0, largest);
      }
    const LargestResidual<double> own = largest;
    for (const LargestResidual<double>& one : gather(transport_, own)) largest.add(one);
    const double residual = final_residual_of(largest, scale_).residual;
    if (sequence.keep(residual))
      for_home_numbers(transport_.rank(), [&](std::size_t number) { best_impulse_[number] = impulse_[number]; });
    return residual;
  }

  /// Asks the judge whether the best impulses are the answer.
  void ask_judge() {
    // An estimate of the same numbers: it may differ from the verdict by a rounding, and so is held against it once.
    if (!sequence.is_within(options_.tolerance, scale_.largest) || sequence.best > 0.5 * refused_at_) return;
    refused_at_ = sequence.best;
    share_best(false);
    std::uint8_t is_solved = 0;
    if (transport_.rank() == 0) is_solved = judge_.verdict(best_impulse_.data()).code == EnvCode::solved ? 1 : 0;
    is_solved_ = gather(transport_, is_solved).front() != 0;
  }

  /// f(place) for the numbers of a rank's contacts.
  template <class F>
  void for_home_numbers(int rank, F&& f) const {
    for (int domain = 0; domain < domains_.count(); ++domain)
      if (home_[at(domain)] == rank)
        for (const Index p : domains_.contacts[at(domain)])
          for (Index k = 0; k < 3; ++k) f(at(3 * Offset{env_.contact_order[p]} + k));
  }

  /// The best impulses of all ranks, to all of them or to rank 0.
  void share_best(bool with_all) {
    std::vector<Letter> out(at(transport_.size()));
    for (int rank = 0; rank < (with_all ? transport_.size() : 1); ++rank)
      if (rank != transport_.rank())
        for_home_numbers(transport_.rank(), [&](std::size_t number) { out[at(rank)].put(best_impulse_[number]); });
    std::vector<Letter> in = exchange_with_all(transport_, out);
    for (int rank = 0; rank < transport_.size(); ++rank)
      if (in[at(rank)].size() > 0)
        for_home_numbers(rank, [&](std::size_t number) { best_impulse_[number] = in[at(rank)].template take<Real>(); });
  }

  void publish(NewtonEnd end) {
    if (!is_refused_) share_best(false);
    if (transport_.rank() != 0) return;
    EnvStatus status = judge_.verdict(is_refused_ ? one_.warm_start : best_impulse_.data());
    if (status.code == EnvCode::max_iterations)
      status.code = end == NewtonEnd::broken    ? EnvCode::numerical
                    : end == NewtonEnd::stalled ? EnvCode::stalled
                                                : EnvCode::max_iterations;
    status.flags |= flags_;
    status.iterations = steps_;
    status.solver = SolverKind::newton;
    judge_.publish(status);
  }

  Transport& transport_;
  const OneEnv<Real>& one_;
  std::span<const int> home_;
  TimeStepping stepping_;
  BodySolverOptions options_;
  SiParams params_;
  EnvJudge<Real> judge_;
  std::optional<BodyPlan> plan_;
  BodyEnv<Real> env_{};
  std::vector<Point> points_;
  Domains domains_;
  Reach reach_;
  std::optional<DomainSpace> space_;
  std::vector<int> owner_;  ///< rank of each body
  /// By contact; a rank has those of its reach, and of the best those of its subdomains.
  std::vector<Real> impulse_, best_impulse_;
  std::vector<double> twist_;  ///< of bodies under all impulses, of the reach's rows
  ErrorScale scale_;
  bool is_refused_ = false, is_solved_ = false;
  std::uint32_t flags_ = 0;
  double refused_at_ = __builtin_huge_val();
  Index steps_ = 0, sweeps_ = 0;
};

}  // namespace

template <class Real>
std::vector<RankReport> solve_by_newton(Transport& transport, const BodyBatchView<Real>& batch,
                                        std::span<const int> part, std::span<const int> home,
                                        const DomainOptions& domains, const TimeStepping& stepping,
                                        const BodySolverOptions& options, const BodySolutionView<Real>& solution,
                                        const Real* warm_start, NewtonCounts* counts) {
  const ScopedFpEnv fp_env;
  require_newton(domains, options);
  const BodySolver solver(Device::cpu(), stepping, for_planning(options));
  if (transport.rank() == 0) solver.check(solver.plan(batch), batch, solution);
  require_owners("part", "subdomain", part, batch.body_count, domains.count);
  require_owners("home", "rank", home, domains.count, transport.size());
  Digest digest;
  digest.add(digest_of(batch, part, stepping, options, warm_start));
  digest.add(home.data(), domains.count);
  for (const bool is_set : {domains.overlap, domains.is_coarse}) digest.add(std::uint64_t{is_set ? 1U : 0U});
  digest.add(static_cast<std::uint64_t>(options.space.ordering));
  digest.add(static_cast<std::uint64_t>(domains.sweeps));
  require_agreement(transport, digest.sum(), "another batch, other options or other subdomains");
  RankReport report;
  NewtonCounts made;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const OneEnv<Real> one(batch, solution, warm_start, env);
    NewtonOfEnv<Real> own(transport, one, part.subspan(at(batch.env_body_offsets[env]), at(one.view.body_count)), home,
                          domains, stepping, options);
    own.solve(report, made);
  }
  if (counts != nullptr) *counts = made;
  return gather(transport, report);
}

template std::vector<RankReport> solve_by_newton(Transport&, const BodyBatchView<float>&, std::span<const int>,
                                                 std::span<const int>, const DomainOptions&, const TimeStepping&,
                                                 const BodySolverOptions&, const BodySolutionView<float>&, const float*,
                                                 NewtonCounts*);
template std::vector<RankReport> solve_by_newton(Transport&, const BodyBatchView<double>&, std::span<const int>,
                                                 std::span<const int>, const DomainOptions&, const TimeStepping&,
                                                 const BodySolverOptions&, const BodySolutionView<double>&,
                                                 const double*, NewtonCounts*);

std::vector<int> neighbouring_homes(int domains, int ranks) {
  std::vector<int> home;
  for (int domain = 0; domain < domains; ++domain)
    home.push_back(static_cast<int>(static_cast<Offset>(domain) * ranks / domains));
  return home;
}

}  // namespace stiction::distributed
