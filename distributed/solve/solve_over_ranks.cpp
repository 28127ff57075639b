#include "distributed/solve/solve_over_ranks.hpp"

#include <chrono>
#include <cstring>
#include <string>

#include "core/base/fp_env.hpp"
#include "distributed/solve/kernels.hpp"
#include "distributed/solve/piece.hpp"
#include "stiction/hash.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

void require_options(const BodySolverOptions& options) {
  if (options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported, "method: ranks solve by BodyMethod::impulses alone; choose it, or one process");
  if (options.max_contacts_per_env != 0)
    throw Error(ErrorCode::unsupported, "max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) +
                                            ": ranks solve all contacts; use 0");
}

void require_owners(std::span<const int> owner, Offset bodies, int ranks) {
  if (owner.size() != at(bodies))
    throw Error(ErrorCode::invalid_argument, "owner has " + std::to_string(owner.size()) + " elements, expected " +
                                                 std::to_string(bodies) + ", one for each body");
  for (std::size_t body = 0; body < owner.size(); ++body)
    if (owner[body] < 0 || owner[body] >= ranks)
      throw Error(ErrorCode::invalid_argument, "owner[" + std::to_string(body) + "] = " + std::to_string(owner[body]) +
                                                   ": expected a rank in 0.." + std::to_string(ranks - 1));
}

/// Adds numbers and integers to a hash of all that reaches the bits, or what is sent.
class Digest {
 public:
  template <class T>
  void add(const T* values, Offset count) {
    if (values == nullptr) return add(std::uint64_t{0});
    if constexpr (std::is_floating_point_v<T>) {
      add(hash_bits(std::span<const T>(values, at(count))));
    } else {
      for (Offset i = 0; i < count; ++i) add(static_cast<std::uint64_t>(values[i]));
    }
  }
  void add(std::uint64_t word) { sum_ = (sum_ ^ word) * 0x100000001b3ULL + 0x9e3779b97f4a7c15ULL; }
  [[nodiscard]] std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325ULL;
};

template <class Real>
std::uint64_t digest_of(const BodyBatchView<Real>& batch, std::span<const int> owner, const TimeStepping& stepping,
                        const BodySolverOptions& options, const Real* warm_start) {
  Digest digest;
  digest.add(batch.env_body_offsets, batch.env_count + 1);
  digest.add(batch.env_contact_offsets, batch.env_count + 1);
  digest.add(batch.kinematic, batch.body_count);
  digest.add(batch.inv_mass, batch.body_count);
  for (const Real* rows : {batch.inv_inertia, batch.twist, batch.twist_change}) digest.add(rows, 6 * batch.body_count);
  for (const Index* rows : {batch.body_a, batch.body_b}) digest.add(rows, batch.contact_count);
  for (const Real* rows : {batch.arm_a, batch.arm_b, batch.normal, warm_start})
    digest.add(rows, 3 * batch.contact_count);
  for (const Real* rows : {batch.mu, batch.depth, batch.restitution}) digest.add(rows, batch.contact_count);
  digest.add(owner.data(), batch.body_count);
  const double numbers[] = {
      stepping.dt,   stepping.erp,     stepping.slop, stepping.cfm, stepping.restitution_threshold,
      options.omega, options.tolerance};
  digest.add(numbers, 7);
  const Index integers[] = {static_cast<Index>(contact_law(options)), options.iterations, options.substeps,
                            options.momentum ? 1 : 0, kNumericsEpoch};
  digest.add(integers, 5);
  return digest.sum();
}

template <class T>
std::vector<T> gather(Transport& transport, const T& mine) {
  std::vector<T> all(static_cast<std::size_t>(transport.size()));
  transport.all_gather(std::as_bytes(std::span(&mine, 1)), std::as_writable_bytes(std::span(all)));
  return all;
}

void require_agreement(Transport& transport, std::uint64_t digest) {
  const std::vector<std::uint64_t> all = gather(transport, digest);
  for (std::size_t rank = 1; rank < all.size(); ++rank)
    if (all[rank] != all[0])
      throw Error(ErrorCode::invalid_argument,
                  "rank " + std::to_string(rank) +
                      " has another batch, other options or other owners than rank 0: give "
                      "all ranks the same");
}

/// Memory that begins on a cache line.
template <class T>
class Scratch {
 public:
  explicit Scratch(Offset count) : numbers_(at(count) + 64 / sizeof(T)) {}
  T* data() {
    void* begin = numbers_.data();
    std::size_t space = numbers_.size() * sizeof(T);
    return static_cast<T*>(std::align(64, 1, begin, space));
  }

 private:
  std::vector<T> numbers_;
};

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

  void solve(RankReport& report) {
    const RankKernels<Real> kernels = rank_kernels<Real>(contact_law(job_.options));
    Scratch<Real> numbers(kernels.elements(piece_.contacts(), piece_.bodies(), job_.options.momentum));
    Scratch<double> exact(kernels.exact_elements(piece_.bodies()));
    Halo halo(transport_, piece_.rounds());
    const Traffic before = transport_.traffic();
    const auto start = std::chrono::steady_clock::now();
    kernels.solve(piece_.job(), numbers.data(), exact.data(), halo);
    report.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const Traffic& after = transport_.traffic();
    report.waited += after.waited - before.waited;
    report.exchanges += after.exchanges - before.exchanges;
    report.gathers += after.gathers - before.gathers;
    report.messages += after.messages - before.messages;
    report.bytes += after.bytes - before.bytes;
    report.bodies += piece_.bodies();
    report.ghosts += piece_.ghosts();
    report.contacts += piece_.contacts();
  }

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
  require_options(options);
  BodySolverOptions alone = options;
  alone.threads = 1;
  const BodySolver solver(Device::cpu(), stepping, alone);
  const BodyPlan plan = solver.plan(batch);
  require_owners(owner, batch.body_count, transport.size());
  if (transport.rank() == 0) solver.check(plan, batch, solution);
  require_agreement(transport, digest_of(batch, owner, stepping, options, warm_start));
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
