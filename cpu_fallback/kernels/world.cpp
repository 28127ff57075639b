#include "core/algorithm/collision/integrate.hpp"
#include "cpu_fallback/tables/world_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
Offset workspace_bytes(const WorldModelView<Real>& model) {
  return model.by_tree ? NearWorkspace<Real>::bytes(model) : ListedPairs<Real>::bytes(model);
}
template <class Real>
Offset count_near_one(const WorldJob<Real>& job, Offset env, void* workspace) {
  SerialTeam team;
  NearWorkspace<Real> near(job.model, workspace);
  prepare_world(team, job, env);
  return count_near_pairs(team, job, env, near);
}
template <class Real>
Index find_one(const WorldJob<Real>& job, Offset env, void* workspace, Index near, void* pairs) {
  SerialTeam team;
  if (!job.model.by_tree) {
    prepare_world(team, job, env);
    return find_contacts(team, job, env, ListedPairs<Real>(job.model, workspace));
  }
  NearWorkspace<Real> tree(job.model, workspace);
  return find_near_contacts(team, job, env, tree, near, pairs);
}
template <class Real>
void list_one(const WorldJob<Real>& job, Offset env, void* workspace, Index near, void* pairs,
              FoundContact<Real>* out) {
  SerialTeam team;
  if (job.model.by_tree) {
    list_contacts(team, job, env, NearPairs<Real>(job.model, NearWorkspace<Real>(job.model, workspace), near, pairs),
                  out);
  } else {
    list_contacts(team, job, env, ListedPairs<Real>(job.model, workspace), out);
  }
}
template <class Real>
void emit_contacts_one(const WorldJob<Real>& job, const ContactSink<Real>& sink, Offset env,
                       const FoundContact<Real>* found) {
  SerialTeam team;
  emit_contacts(team, job.model, sink, env, found);
}
template <class Real>
void integrate_one(const WorldJob<Real>& job, Offset env) {
  SerialTeam team;
  integrate_world(team, job, env);
}
template <class Real>
WorldMotion motion_one(const WorldJob<Real>& job, Offset env) {
  return motion_of(job, env);
}

template <class Real>
cpu::WorldKernels<Real> kernels() {
  return {workspace_bytes<Real>, NearPairs<Real>::bytes,  count_near_one<Real>, find_one<Real>,
          list_one<Real>,        emit_contacts_one<Real>, integrate_one<Real>,  motion_one<Real>};
}

}  // namespace

cpu::WorldKernelSet world_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
