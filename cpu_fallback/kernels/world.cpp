#include "core/algorithm/collision/integrate.hpp"
#include "cpu_fallback/kernels/world_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
std::size_t workspace_bytes(const WorldModelView<Real>& model) {
  return static_cast<std::size_t>(DetectWorkspace<Real>::bytes(model));
}
template <class Real>
Index find_one(const WorldJob<Real>& job, Offset env, void* workspace) {
  SerialTeam team;
  prepare_world(team, job, env);
  return find_contacts(team, job, env, DetectWorkspace<Real>(job.model, workspace));
}
template <class Real>
void list_one(const WorldJob<Real>& job, Offset env, void* workspace, FoundContact<Real>* out) {
  SerialTeam team;
  list_contacts(team, job, env, DetectWorkspace<Real>(job.model, workspace), out);
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
  return {workspace_bytes<Real>,   find_one<Real>,      list_one<Real>,
          emit_contacts_one<Real>, integrate_one<Real>, motion_one<Real>};
}

}  // namespace

cpu::WorldKernelSet world_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
