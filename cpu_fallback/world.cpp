#include "core/algorithm/collision/integrate.hpp"
#include "cpu_fallback/world_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
std::size_t room_bytes(const WorldModelView<Real>& model) {
  return static_cast<std::size_t>(DetectRoom<Real>::bytes(model));
}
template <class Real>
Index find_one(const WorldJob<Real>& job, Offset env, void* room) {
  SerialBlock block;
  prepare_world(block, job, env);
  return find_contacts(block, job, env, DetectRoom<Real>(job.model, room));
}
template <class Real>
void list_one(const WorldJob<Real>& job, Offset env, void* room, FoundContact<Real>* out) {
  SerialBlock block;
  list_contacts(block, job, env, DetectRoom<Real>(job.model, room), out);
}
template <class Real>
void hand_over_one(const WorldJob<Real>& job, const ContactSink<Real>& sink, Offset env,
                   const FoundContact<Real>* found) {
  SerialBlock block;
  hand_over(block, job.model, sink, env, found);
}
template <class Real>
void integrate_one(const WorldJob<Real>& job, Offset env) {
  SerialBlock block;
  integrate_world(block, job, env);
}
template <class Real>
WorldMotion motion_one(const WorldJob<Real>& job, Offset env) {
  return motion_of(job, env);
}

template <class Real>
cpu::WorldKernels<Real> kernels() {
  return {room_bytes<Real>, find_one<Real>, list_one<Real>, hand_over_one<Real>, integrate_one<Real>, motion_one<Real>};
}

}  // namespace

cpu::WorldKernelSet world_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
