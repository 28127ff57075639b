#include "distributed/solve/solve_over_ranks.hpp"

#include <string>

#include "core/base/fp_env.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/solve/piece.hpp"
#include "distributed/solve/solve_piece.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

/// Solves the piece of one environment, and collects the answer on rank 0.
template <class Real>
class EnvOverRanks {
 public:
  EnvOverRanks(Transport& transport, const BodyJob<Real>& job, const BodyPlanData& plan, Offset env,
               std::span<const int> owner)
      : transport_(transport),
        job_(job),
        plan_(plan),
        env_(env),
        owner_(owner),
        piece_(job, plan, env, owner, transport.rank()) {}

  void solve(RankReport& report) { solve_piece(transport_, piece_.job(), piece_.rounds(), piece_.ghosts(), report); }

  void collect(const BodySolutionView<Real>& solution, bool with_w) {
    const std::vector<Real> own = piece_.answer(with_w);
    if (transport_.rank() != 0) {
      const Outgoing out{0, std::as_bytes(std::span(own))};
      if (!own.empty()) transport_.exchange({&out, 1}, {});
      return;
    }
    const Visitors visitors(plan_, env_, owner_);
    std::vector<std::vector<Real>> answers(static_cast<std::size_t>(transport_.size()));
    std::vector<Incoming> in;
    for (int rank = 1; rank < transport_.size(); ++rank) {
      std::vector<Real>& answer = answers[static_cast<std::size_t>(rank)];
      answer.resize(answer_size(plan_, env_, visitors, owner_, rank, with_w));
      if (!answer.empty()) in.push_back({rank, std::as_writable_bytes(std::span(answer))});
    }
    if (!in.empty()) transport_.exchange({}, in);
    answers.front() = own;
    for (int rank = 0; rank < transport_.size(); ++rank)
      take_answer(job_.batch, plan_, env_, visitors, owner_, rank,
                  std::span<const Real>(answers[static_cast<std::size_t>(rank)]), solution);
    solution.status[env_] = piece_.status();
  }

 private:
  Transport& transport_;
  const BodyJob<Real>& job_;
  const BodyPlanData& plan_;
  Offset env_;
  std::span<const int> owner_;
  Piece<Real> piece_;
};

}  // namespace

template <class Real>
std::vector<RankReport> solve_over_ranks(Transport& transport, const BodyBatchView<Real>& batch,
                                         std::span<const int> owner, const TimeStepping& stepping,
                                         const BodySolverOptions& options, const BodySolutionView<Real>& solution,
                                         const Real* warm_start) {
  const ScopedFpEnv fp_env;
  require_impulses(options);
  BodySolverOptions alone = options;
  alone.threads = 1;
  const BodySolver solver(Device::cpu(), stepping, alone);
  const BodyPlan plan = solver.plan(batch);
  require_owners("owner", "rank", owner, batch.body_count, transport.size());
  if (transport.rank() == 0) solver.check(plan, batch, solution);
  require_agreement(transport, digest_of(batch, owner, stepping, options, warm_start),
                    "another batch, other options or other owners");
  const auto with_w = gather(transport, static_cast<std::uint8_t>(solution.w != nullptr ? 1 : 0));
  const BodyJob<Real> job{batch, plan.data().view(), solution, warm_start, stepping, options};
  RankReport report;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first = batch.env_body_offsets[env];
    EnvOverRanks<Real> own(transport, job, plan.data(), env,
                           owner.subspan(at(first), at(batch.env_body_offsets[env + 1] - first)));
    own.solve(report);
    own.collect(solution, with_w.front() != 0);
  }
  return gather(transport, report);
}

template std::vector<RankReport> solve_over_ranks(Transport&, const BodyBatchView<float>&, std::span<const int>,
                                                  const TimeStepping&, const BodySolverOptions&,
                                                  const BodySolutionView<float>&, const float*);
template std::vector<RankReport> solve_over_ranks(Transport&, const BodyBatchView<double>&, std::span<const int>,
                                                  const TimeStepping&, const BodySolverOptions&,
                                                  const BodySolutionView<double>&, const double*);

}  // namespace stiction::distributed
