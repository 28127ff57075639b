#include "cuda/plan_cache.hpp"

#include "cuda/transfer.hpp"

namespace stiction::cuda {

namespace {

bool same_owner(const std::weak_ptr<const PlanData>& a, const std::weak_ptr<const PlanData>& b) {
  return !a.owner_before(b) && !b.owner_before(a);
}

}  // namespace

const DevicePlan& PlanCache::get(const PlanData& plan, cudaStream_t stream) {
  // A plan that nobody shares can change or vanish unseen; its copy is expired from the start and lasts for this solve.
  plans_.remove_if([](const DevicePlan& known) { return known.owner.expired(); });
  const std::weak_ptr<const PlanData> owner = plan.weak_from_this();
  if (!owner.expired())
    for (const DevicePlan& known : plans_)
      if (same_owner(known.owner, owner)) {
        known.uploaded.hold(stream);
        return known;
      }
  plans_.push_back(upload(plan));
  plans_.back().owner = owner;
  plans_.back().uploaded.hold(stream);
  return plans_.back();
}

void PlanCache::used_on(cudaStream_t stream) {
  done_.record(stream);
  done_.hold(stream_.get());
}

DevicePlan PlanCache::upload(const PlanData& plan) {
  DevicePlan copy;
  copy.layout = make_layout(plan, rules_);
  ArraySet arrays;
  const auto add = [&](auto*& target, const auto& source) {
    arrays.add(target, source.data(), static_cast<Offset>(source.size()));
  };
  add(copy.view.path, plan.path);
  add(copy.view.counts, plan.counts);
  add(copy.view.cone_order, plan.cone_order);
  add(copy.view.env_vertex_offsets, plan.env_vertex_offsets);
  add(copy.view.vertex_offsets, plan.vertex_offsets);
  add(copy.view.env_color_offsets, plan.env_color_offsets);
  add(copy.view.color_offsets, plan.color_offsets);
  add(copy.view.color_count, plan.color_count);
  add(copy.envs, copy.layout.envs);
  add(copy.offsets, copy.layout.offsets);
  copy.memory = arrays.allocate(*pool_, stream_.get());
  copy.uploaded.record(stream_.get());
  return copy;
}

}  // namespace stiction::cuda
