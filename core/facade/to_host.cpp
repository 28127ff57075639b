#include <cstring>

#include "core/facade/host_copy.hpp"
#include "core/machine/contact_machine.hpp"
#include "core/runtime/batch/append_environment.hpp"
#include "core/runtime/check/defects.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

void require_structure(const std::vector<Defect>& defects) {
  if (defects.empty()) return;
  throw Error(ErrorCode::invalid_argument, "the batch cannot be copied: " + defects.front().message);
}

/// Copies the part in use of a host batch, one environment after another.
template <class Real>
ContactBatch<Real> packed(const ContactBatchView<Real>& batch) {
  typename ContactBatch<Real>::Arrays to;
  to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
  if (batch.factor_offsets != nullptr) to.factor_offsets = {0};
  for (Offset env = 0; env < batch.env_count; ++env) append_environment(to, batch, env);
  return ContactBatch<Real>::from_arrays(batch.law, std::move(to));
}

}  // namespace

void Solver::copy_to_host(void* target, const void* source, std::size_t bytes, MemorySpace space,
                          StreamRef stream) const {
  if (bytes == 0) return;
  if (space == MemorySpace::host)
    std::memcpy(target, source, bytes);
  else
    machine_->copy_to_host(target, source, bytes, stream);
}

template <class Real>
ContactBatch<Real> Solver::to_host(const ContactBatchView<Real>& batch, StreamRef stream) const {
  if (batch.normal_last)
    throw Error(ErrorCode::unsupported,
                "batch.normal_last is set, which no ContactBatch can say: put the normal first");
  if (batch.space == MemorySpace::host) {
    require_structure(validate_structure(batch, 1));
    return packed(batch);
  }
  const HostCopy<Real> host(batch, true, *machine_, stream);
  require_structure(validate_structure(host.view(), 1));
  return packed(host.view());
}

template ContactBatch<float> Solver::to_host(const ContactBatchView<float>&, StreamRef) const;
template ContactBatch<double> Solver::to_host(const ContactBatchView<double>&, StreamRef) const;

}  // namespace stiction
