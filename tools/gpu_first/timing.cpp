#include "tools/gpu_first/timing.hpp"

#include <algorithm>
#include <cstdio>

namespace stiction::gpu_first {

Time time_graph(Target& target, cuda::StreamHandle stream, int repeats, const std::function<void()>& queue) {
  const auto api = target.api();
  queue();
  api->synchronize(stream);
  const auto launch = target.capture(stream, queue);
  launch();
  const cuda::Event from(*api, cuda::EventUse::timing), to(*api, cuda::EventUse::timing);
  std::vector<double> times;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    api->record(from.get(), stream);
    launch();
    api->record(to.get(), stream);
    api->synchronize(stream);
    times.push_back(api->microseconds(from.get(), to.get()).value_or(0.0));
  }
  std::sort(times.begin(), times.end());
  return {times[times.size() / 2], times.front()};
}

std::string brief(double nanoseconds) {
  char text[24];
  std::snprintf(text, sizeof text, nanoseconds < 100 ? "%.1f" : "%.0f", nanoseconds);
  return text;
}

Timed::Timed(Target& target, const ContactBatch<float>& batch, const SolverOptions& options)
    : target_(target),
      api_(target.api()),
      batch_(batch),
      options_(options),
      engine_(*api_),
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

Time Timed::solve(int repeats, bool with_plan) {
  queue(false);
  return time_graph(target_, stream_.get(), repeats, [&] { queue(!with_plan); });
}

}  // namespace stiction::gpu_first
