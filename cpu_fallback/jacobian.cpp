#include "core/body/jacobian_body.hpp"
#include "cpu_fallback/jacobian_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
Offset elements_of(const JacobianJob<Real>& job, Offset env) {
  return jacobian_elements(job.batch, env);
}
template <class Real>
void assemble_one(const JacobianJob<Real>& job, Offset env, Real* scratch) {
  SerialBlock block;
  assemble_env(block, job, env, scratch);
}
template <class Real>
void velocity_one(const JacobianJob<Real>& job, Offset env, Real* scratch) {
  SerialBlock block;
  velocity_env(block, job, env, scratch);
}

}  // namespace

cpu::JacobianKernelSet jacobian_kernels() {
  return {{elements_of<float>, assemble_one<float>, velocity_one<float>},
          {elements_of<double>, assemble_one<double>, velocity_one<double>}};
}

}  // namespace stiction::inline STICTION_ISA
