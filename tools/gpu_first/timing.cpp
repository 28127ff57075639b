#include "tools/gpu_first/timing.hpp"

#include <algorithm>

#include "tests/support/systems/scene_batches.hpp"

namespace stiction::gpu_first {

Timed::Timed(Target& target, const ContactBatch<float>& batch, const SolverOptions& options,
             const cuda::ClassRules& rules)
    : target_(target),
      api_(target.api()),
      batch_(batch),
      options_(options),
      engine_(*api_, rules),
      stream_(*api_),
      there_(*api_, Capacity::of(batch.view())) {
  engine_.reserve(Capacity::of(batch.view()), options.solver, Precision::f32);
  there_.fill(batch, stream_.get());
}

void Timed::queue(bool is_planned) {
  engine_.solve(SolveRequest<float>{nullptr, there_.view(), there_.solution(), nullptr,
                                    options_.law.value_or(batch_.law()), options_, StreamRef(stream_.get())},
                is_planned);
}

Timed::Time Timed::solve(int repeats, bool with_plan) {
  queue(false);
  api_->synchronize(stream_.get());
  const auto launch = target_.capture(stream_.get(), [&] { queue(!with_plan); });
  launch();
  const cuda::Event from(*api_, cuda::EventUse::timing), to(*api_, cuda::EventUse::timing);
  std::vector<double> times;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    api_->record(from.get(), stream_.get());
    launch();
    api_->record(to.get(), stream_.get());
    api_->synchronize(stream_.get());
    times.push_back(api_->microseconds(from.get(), to.get()).value_or(0.0));
  }
  std::sort(times.begin(), times.end());
  return {times[times.size() / 2], times.front()};
}

Hashes Timed::hashes() {
  return test::env_hashes(batch_, there_.fetch(batch_, stream_.get()));
}

}  // namespace stiction::gpu_first
