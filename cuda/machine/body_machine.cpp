#include "cuda/machine/body_machine.hpp"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "core/algorithm/rigid/newton/precondition.hpp"
#include "core/base/extents.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/mover.hpp"
#include "cuda/machine/body_classes.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "stiction/batch_arrays.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace cuda {

DeviceBodyMachine::DeviceBodyMachine(std::shared_ptr<DeviceApi> api, bool eager)
    : api_(std::move(api)), eager_(eager) {}

void DeviceBodyMachine::copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) {
  if (bytes == 0) return;
  api_->copy(target, source, bytes, CopyKind::to_host, stream.handle());
  api_->synchronize(stream.handle());
}

template <class Real>
void DeviceBodyMachine::make_classes(const BodyRequest<Real>& request, std::vector<Offset>& order) {
  static_assert(kClasses == kBodyClasses);
  const BodyPlanData& plan = *request.plan;
  const BodyClassifier<Real> classifier(request.options, api_->facts());
  const auto contacts = [&](Offset env) { return plan.kept[static_cast<std::size_t>(env)]; };
  const auto bodies = [&](Offset env) {
    const auto e = static_cast<std::size_t>(env);
    return plan.env_body_offsets[e + 1] - plan.env_body_offsets[e];
  };
  const auto class_of = [&](Offset env) { return classifier.class_of(contacts(env), bodies(env)); };
  order.resize(plan.kept.size());
  std::iota(order.begin(), order.end(), Offset{0});
  std::sort(order.begin(), order.end(), [&](Offset a, Offset b) {
    const int class_a = class_of(a), class_b = class_of(b);
    if (class_a != class_b) return class_a < class_b;
    return contacts(a) != contacts(b) ? contacts(a) > contacts(b) : a < b;
  });
  const bool is_newton = request.options.method == BodyMethod::newton;
  Offset next = 0;
  for (int k = 0; k < kClasses; ++k) {
    const bool bundled = k < kBundleClasses;
    Class& own = classes_[static_cast<std::size_t>(k)];
    own = Class{};
    own.begin = next;
    BodyNeed most{0, 0};
    for (; next < static_cast<Offset>(order.size()); ++next) {
      const Offset env = order[static_cast<std::size_t>(next)];
      if (class_of(env) != k) break;
      BodyNeed need = bundled ? need_of<Real, kWarp>(request.options, contacts(env), bodies(env))
                              : need_of<Real, 1>(request.options, contacts(env), bodies(env));
      if (is_newton)
        need.exact += newton_doubles(contacts(env),
                                     plan.newton_stream.data() + plan.newton_offsets[static_cast<std::size_t>(env)],
                                     request.options.space);
      most = {larger_of(most.elements, need.elements), larger_of(most.exact, need.exact)};
      own.slot_bytes = larger_of(own.slot_bytes, need.bytes<Real>());
    }
    own.end = next;
    if (own.end == own.begin) continue;
    if (bundled) {
      own.slot_elements = most.elements;
      own.shape = {(own.end - own.begin + kWarp - 1) / kWarp, kWarp, bundle_bytes<Real>(most)};
      continue;
    }
    const TeamRule& rule = kTeamRules[k - kBundleClasses];
    own.slot_bytes = static_cast<Offset>(padded_bytes(at(own.slot_bytes)));
    own.shape.lanes = rule.lanes;
    own.shape.whole_device = k + 1 == kClasses;
    const Offset fitting = larger_of<Offset>(1, most_workspace_bytes(api_->facts()) / own.slot_bytes);
    own.shape.teams =
        own.shape.whole_device
            ? 1
            : smaller_of(own.end - own.begin, smaller_of(fitting, rule.per_processor * api_->facts().processors));
    own.workspace_bytes = own.shape.teams * own.slot_bytes;
  }
}

template <class Real>
void DeviceBodyMachine::load(const BodyRequest<Real>& request) {
  const BodySolverOptions& options = request.options;
  const Reserved wanted{request.plan, sizeof(Real), contact_law(options), options.momentum, options.method};
  if (reserved_ == wanted) return;
  if (api_->capturing(request.stream.handle()))
    throw Error(ErrorCode::invalid_argument,
                "stream is being captured and nothing has been solved yet with this plan and these options: solve once "
                "before the capture");
  reserved_ = Reserved{};
  const BodyPlanData& plan = *request.plan;
  std::vector<Offset> order;
  make_classes(request, order);

  ArraySet arrays;
  Index* integers[8] = {};
  const std::vector<Index>* const source[8] = {&plan.kept,           &plan.contact_order, &plan.sides,
                                               &plan.vertex_offsets, &plan.color_offsets, &plan.color_count,
                                               &plan.body_offsets,   &plan.body_contacts};
  Index* newton_stream = nullptr;
  Offset* newton_offsets = nullptr;
  const bool is_newton = options.method == BodyMethod::newton;
  if (is_newton) {
    arrays.add(newton_stream, static_cast<Offset>(plan.newton_stream.size()));
    arrays.add(newton_offsets, static_cast<Offset>(plan.newton_offsets.size()));
  }
  Offset* order_there = nullptr;
  for (std::size_t k = 0; k < 8; ++k) arrays.add(integers[k], static_cast<Offset>(source[k]->size()));
  arrays.add(order_there, static_cast<Offset>(order.size()));
  arrays.add(ticket_, kClasses);
  ArraySet slots;
  for (Class& own : classes_) slots.add(own.workspace, own.workspace_bytes);

  // Earlier runs may still read memory that is about to be freed or written.
  api_->synchronize(request.stream.handle());
  arrays_.make_room(*api_, arrays.bytes());
  workspace_.make_room(*api_, slots.bytes());
  arrays.place(arrays_.get());
  slots.place(workspace_.get());
  queue_all(*api_, request.stream.handle(), [&] {
    Mover mover(*api_, request.stream.handle());
    for (std::size_t k = 0; k < 8; ++k)
      mover.to_device(integers[k], source[k]->data(), static_cast<Offset>(source[k]->size()));
    if (is_newton) {
      mover.to_device(newton_stream, plan.newton_stream.data(), static_cast<Offset>(plan.newton_stream.size()));
      mover.to_device(newton_offsets, plan.newton_offsets.data(), static_cast<Offset>(plan.newton_offsets.size()));
    }
    mover.to_device(order_there, order.data(), static_cast<Offset>(order.size()));
    api_->synchronize(request.stream.handle());
  });
  order_ = order_there;
  plan_ = {integers[0], integers[1], integers[2], integers[3],   integers[4],
           integers[5], integers[6], integers[7], newton_stream, newton_offsets};
  reserved_ = wanted;
}

template <class Real>
void DeviceBodyMachine::run_on_device(const BodyRequest<Real>& request) {
  load(request);
  const StreamHandle stream = request.stream.handle();
  const int precision = sizeof(Real) == sizeof(float) ? 0 : 1;
  const int law = static_cast<int>(contact_law(request.options));
  const SolveBodyKernels& kernels = api_->kernels().bodies.by_precision_and_law[precision][law];
  const KernelRef& teams = request.options.method == BodyMethod::newton
                               ? api_->kernels().newton_bodies.by_precision_and_law[precision][law]
                               : kernels.teams;
  if (request.batch.env_count == 0) return;
  api_->fill_zero(ticket_, kClasses * sizeof(Offset), stream);
  const BodyJob<Real> job{request.batch,    plan_,          request.solution, request.warm_start,
                          request.stepping, request.options};
  for (std::size_t k = 0; k < classes_.size(); ++k) {
    const Class& own = classes_[k];
    if (own.begin == own.end) continue;
    const BodyQueue queue{order_, own.begin, own.end, ticket_ + k};
    if (own.slot_elements > 0) {
      const BodyBundleArgs<Real> args{job, queue, own.slot_elements};
      api_->launch(kernels.bundles, own.shape, &args, stream);
    } else {
      const BodiesArgs<Real> args{job, queue, own.workspace, own.slot_bytes};
      api_->launch(teams, own.shape, &args, stream);
    }
  }
}

template <class Real>
void DeviceBodyMachine::run_from_host(const BodyRequest<Real>& request) {
  const BodyBatchView<Real>& host = request.batch;
  BodyRequest<Real> there = request;
  ArraySet arrays;
  BodyBatchView<Real> read = host;
  // Not read by a kernel: the plan holds them.
  read.body_a = read.body_b = nullptr;
  there.batch.contact_id = nullptr;
  for_each_array(
      host,
      [&](const BatchArray& what, auto*& target, const auto* source) {
        target = nullptr;
        if (source != nullptr) arrays.add(target, what.length);
      },
      there.batch, read);
  Real* warm = nullptr;
  if (request.warm_start != nullptr) arrays.add(warm, 3 * host.contact_count);
  arrays.add(there.solution.impulse, 3 * host.contact_count);
  arrays.add(there.solution.twist, 6 * host.body_count);
  there.solution.w = nullptr;
  if (request.solution.w != nullptr) arrays.add(there.solution.w, 3 * host.contact_count);
  arrays.add(there.solution.status, host.env_count);
  const DeviceMemory memory(*api_, arrays.bytes());
  arrays.place(memory.get());
  there.warm_start = warm;
  queue_all(*api_, request.stream.handle(), [&] {
    Mover mover(*api_, request.stream.handle());
    for_each_array(
        host,
        [&](const BatchArray& what, const auto* target, const auto* source) {
          mover.to_device(target, source, what.length);
        },
        there.batch, read);
    mover.to_device(warm, request.warm_start, 3 * host.contact_count);
    run_on_device(there);
    mover.to_host(request.solution.impulse, there.solution.impulse, 3 * host.contact_count);
    mover.to_host(request.solution.twist, there.solution.twist, 6 * host.body_count);
    mover.to_host(request.solution.w, there.solution.w, 3 * host.contact_count);
    mover.to_host(request.solution.status, there.solution.status, host.env_count);
    api_->synchronize(request.stream.handle());
  });
}

template <class Real>
void DeviceBodyMachine::run(const BodyRequest<Real>& request) {
  const std::lock_guard lock(mutex_);
  if (request.batch.space == MemorySpace::host) {
    run_from_host(request);
  } else {
    run_on_device(request);
    if (eager_) api_->synchronize(request.stream.handle());
  }
}

void DeviceBodyMachine::solve(const BodyRequest<float>& request) {
  run(request);
}
void DeviceBodyMachine::solve(const BodyRequest<double>& request) {
  run(request);
}

}  // namespace cuda

}  // namespace stiction
