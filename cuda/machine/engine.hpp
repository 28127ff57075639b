#pragma once

#include <array>
#include <bitset>
#include <memory>

#include "core/job/plan_view.hpp"
#include "core/job/size_class.hpp"
#include "core/machine/contact_machine.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/kernels/plan_args.hpp"
#include "cuda/kernels/work_queue.hpp"
#include "cuda/machine/stream_timer.hpp"
#include "stiction/solver.hpp"

namespace stiction::cuda {

template <class Real>
inline constexpr Precision kPrecisionOf = sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;

/// Rules that decide the class of a dense environment. It reaches speed only: other rules are for measuring, and for
/// tests that a class changes no bit.
struct ClassRules {
  ClassLimits limits;  ///< but for thread_large
  Offset many_per_processor =
      500;  ///< environments of a batch, from which a lane each fills the device: 66 000 on an H200
  Index most_rows_of_many = 72;  ///< rows of an environment that has a lane then

  /// The smallest dense environments are of this class.
  static ClassRules from(SizeClass finest) {
    ClassRules rules;
    rules.limits = rules.limits.from(finest);
    if (finest == SizeClass::thread_large) rules.many_per_processor = 0;
    if (finest < SizeClass::thread_large) rules.most_rows_of_many = 0;
    return rules;
  }
};

/// Plans and solves batches that are on the device. Memory is there before a solve begins, so a solve is a number of
/// launches and nothing else. It returns at once and can be captured into a graph. Everything about the batch but its
/// largest extent is read on the device. A graph may hence be replayed with other numbers, other contacts and other
/// sizes of environments.
class Engine {
 public:
  explicit Engine(DeviceApi& api, const ClassRules& rules = {});
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// Makes room, if there is not enough: for batches within `capacity`, solved by `solver`, in either precision or f32
  /// alone. Waits for running work. \throws Error(out_of_memory), or Error(invalid_argument) if the room there is has
  /// been captured into graphs, which would be left without it. The room there was is then kept.
  void reserve(const Capacity& capacity, SolverKind solver, Precision precision);
  /// Returns true if a solve was captured: graphs then write the plan's arrays whenever they are launched.
  [[nodiscard]] bool captured() const noexcept { return captured_; }
  /// Returns true if there is room for batches within `capacity`, and for solving them so.
  [[nodiscard]] bool has_room(const Capacity& capacity) const;
  [[nodiscard]] bool has_reserved(const Capacity& capacity, SolverKind solver, Precision precision) const;

  /// One solve of a batch in device memory. `is_planned`: the batch has the structure of the one before, whose plan is
  /// on the device already.
  template <class Real>
  void solve(const SolveRequest<Real>& request, bool is_planned = false);

  /// Times the work that this engine queues, and work queued around it.
  [[nodiscard]] StreamTimer& timer() noexcept { return timer_; }

  /// Finds the islands of a batch in device memory, of environments within the room.
  void islands(const BatchStructure& batch, Index* island, Index* count, StreamHandle stream);

  /// Returns the last plan on the device, for tests that compare its integers.
  [[nodiscard]] const PlanArrays& plan_arrays() const noexcept { return plan_; }

 private:
  static constexpr int kBranches = 3;

  /// Launch of a class of environments.
  struct ClassShape {
    LaunchShape launch;
    Offset slot_elements[2] = {};  ///< numbers that an environment takes, by Precision
    bool shared = true;
    std::size_t workspace_bytes = 0;  ///< in device memory, of all teams
    std::byte* workspace = nullptr;
  };

  using Shapes = std::array<ClassShape, kSizeClasses>;

  struct Reserved {
    Capacity capacity;
    std::bitset<kSolverKindCount> solvers;  ///< those within the room
    bool has_doubles = false;               ///< room for solves in double precision, too
  };

  [[nodiscard]] static std::bitset<kSolverKindCount> stages_of(SolverKind solver);
  [[nodiscard]] const Workspace& method_workspace(SolverKind solver) const;
  [[nodiscard]] ClassLimits limits_for(const Workspace& method, Offset envs) const;
  [[nodiscard]] ClassLimits limits_for(SolverKind solver, Offset envs) const;
  [[nodiscard]] ClassLimits limits_for(SolverKind solver, const BatchStructure& batch) const;
  [[nodiscard]] ClassLimits limits_of_turn(int turn, Offset envs) const;
  [[nodiscard]] bool may_take(int turn) const;
  template <class Real>
  [[nodiscard]] Offset slot_elements(SizeClass size_class, const Capacity& capacity, const Workspace& method) const;
  [[nodiscard]] ClassShape shape_of(SizeClass size_class, const Reserved& reserved, const Workspace& method) const;
  [[nodiscard]] const Shapes& shapes_of(SolverKind solver) const { return shapes_[static_cast<std::size_t>(solver)]; }
  [[nodiscard]] bool has_class(SolverKind solver, SizeClass size_class) const;
  [[nodiscard]] const KernelRef& kernel_of(SolverKind solver, SizeClass size_class, Precision precision, Law law) const;
  void prepare_launches(Precision precision);
  template <class Real>
  void queue_solve(const SolveRequest<Real>& request, bool is_planned);
  template <class Real>
  void queue_trivial(const SolveRequest<Real>& request, const SolveJob<Real>& job, int lane, StreamHandle stream);
  template <class Real>
  void queue_class(const SolveRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                   SizeClass size_class, int lane, StreamHandle stream);
  template <class Real>
  void queue_classes(const SolveRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                     const ClassLimits& limits, bool with_trivial);
  template <class Real>
  void queue_fallbacks(const SolveRequest<Real>& request, SolveJob<Real> job);
  template <class Real>
  void queue_plan(const SolveRequest<Real>& request);
  void wait_for_all();
  void finish(StreamHandle stream) noexcept;

  DeviceApi& api_;
  ClassRules rules_;
  StreamTimer timer_;
  Reserved reserved_;
  bool captured_ = false;
  DeviceMemory memory_;
  PlanArrays plan_;
  ChainArrays chain_{};                          ///< of the fallback chain
  std::array<Shapes, kSolverKindCount> shapes_;  ///< of each solver there is room for: a stage takes its own
  LaunchShape sort_;                             ///< of the program that sorts environments into classes
  LaunchShape graph_;                            ///< of programs that look at whole graphs
  std::array<std::unique_ptr<Stream>, kBranches> branch_;
  std::array<std::unique_ptr<Event>, kBranches> joined_;
  std::unique_ptr<Event> forked_;
  std::unique_ptr<Event> done_;
};

}  // namespace stiction::cuda
