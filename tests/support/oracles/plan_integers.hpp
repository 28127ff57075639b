#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "core/plan/plan.hpp"
#include "cuda/machine/engine.hpp"
#include "tests/support/machines/device_batch.hpp"

/// The integers of a device's scheduler, against the host's planner and a library's sort.
namespace stiction::test {

/// Indices of the keys in their order, equal ones in the order they have.
inline std::vector<Offset> stable_order(const std::vector<std::uint8_t>& keys) {
  std::vector<Offset> order(keys.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Offset>(i);
  std::stable_sort(order.begin(), order.end(), [&](Offset a, Offset b) {
    return keys[static_cast<std::size_t>(a)] < keys[static_cast<std::size_t>(b)];
  });
  return order;
}
using SortKeys = std::function<std::vector<Offset>(const std::vector<std::uint8_t>&)>;

/// Reads a device's arrays and compares them.
class PlanComparison {
 public:
  explicit PlanComparison(cuda::DeviceApi& api) : api_(api), stream_(api) {}

  /// Empty, or the first difference.
  std::string difference(const ContactBatch<double>& batch, const cuda::PlanArrays& device, const SortKeys& sort,
                         const ClassLimits& limits) {
    const ContactBatchView<double> view = batch.view();
    const PlanData host = make_plan(view);
    const Offset envs = view.env_count;
    compare("path", array(device.path, envs), host.path);
    compare("counts", array(device.counts, envs), host.counts);
    compare("color_count", array(device.color_count, envs), host.color_count);
    compare("cone_order", array(device.cone_order, view.cone_count), host.cone_order);
    compare("flags", array(device.flags, envs), std::vector<std::uint32_t>(static_cast<std::size_t>(envs), 0));
    std::vector<std::uint8_t> keys;
    std::vector<Offset> class_begin(kSizeClasses + 1, 0);
    for (Offset env = 0; env < envs; ++env) {
      const EnvPath path = host.path[static_cast<std::size_t>(env)];
      const SizeClass expected = size_class(path, view.env_rows(env), limits);
      keys.push_back(static_cast<std::uint8_t>(sort_key(expected, view.env_rows(env), limits)));
      ++class_begin[static_cast<std::size_t>(expected) + 1];
      if (path == EnvPath::sparse) compare_graph(device, host, env);
    }
    for (int k = 0; k < kSizeClasses; ++k)
      class_begin[static_cast<std::size_t>(k) + 1] += class_begin[static_cast<std::size_t>(k)];
    compare("key", array(device.key, envs), keys);
    compare("class_begin", array(device.class_begin, kSizeClasses + 1), class_begin);
    compare("order", array(device.order, envs), sort(keys));
    return found_;
  }

 private:
  template <class T>
  std::vector<T> array(const T* data, Offset count) {
    std::vector<T> host(static_cast<std::size_t>(count));
    if (host.empty()) return host;
    api_.copy(host.data(), data, host.size() * sizeof(T), cuda::CopyKind::to_host, stream_.get());
    api_.synchronize(stream_.get());
    return host;
  }

  template <class T>
  void compare(const std::string& name, const std::vector<T>& device, const std::vector<T>& host) {
    if (!found_.empty() || device == host) return;
    std::size_t first = 0;
    while (first < std::min(device.size(), host.size()) && device[first] == host[first]) ++first;
    found_ = name + " differs from the host's at " + std::to_string(first) + " of " + std::to_string(host.size());
  }

  /// Vertices and colours of a sparse environment.
  void compare_graph(const cuda::PlanArrays& device, const PlanData& host, Offset env) {
    const auto index = static_cast<std::size_t>(env);
    const Offset first = array(device.env_vertex_offsets + env, 1)[0];
    const auto same = [&](const char* name, const auto* there, const auto& own, const std::vector<Offset>& offsets) {
      const Offset begin = offsets[index], count = offsets[index + 1] - begin;
      compare(std::string(name) + " of environment " + std::to_string(env), array(there + first, count),
              {own.begin() + begin, own.begin() + begin + count});
    };
    same("vertex_offsets", device.vertex_offsets, host.vertex_offsets, host.env_vertex_offsets);
    same("color_offsets", device.color_offsets, host.color_offsets, host.env_color_offsets);
  }

  cuda::DeviceApi& api_;
  cuda::Stream stream_;
  std::string found_;
};

/// Plans a batch on a device and solves nothing, since no iteration is allowed. Empty, or the difference. `are_many`:
/// as if its environments filled the device, a lane each.
inline std::string difference_of_plans(cuda::DeviceApi& device, const ContactBatch<double>& batch,
                                       const SortKeys& sort = stable_order, bool are_many = false) {
  cuda::ClassRules rules;
  rules.many_per_processor = are_many ? 0 : batch.view().env_count + 1;
  const ClassLimits few = rules.limits, many = few.with(SizeClass::thread_large, rules.most_rows_of_many);
  SolverOptions options;
  options.max_iterations = 0;
  const Capacity need = Capacity::of(batch.view());
  cuda::Engine engine(device, rules);
  engine.reserve(need, options.solver, Precision::f64);
  const cuda::Stream stream(device);
  DeviceBatch<double> there(device, need);
  there.fill(batch, stream.get());
  engine.solve(SolveRequest<double>{nullptr, there.view(), there.solution(), nullptr, batch.law(), options,
                                    StreamRef(stream.get())});
  device.synchronize(stream.get());
  return PlanComparison(device).difference(batch, engine.plan_arrays(), sort, are_many ? many : few);
}

}  // namespace stiction::test
