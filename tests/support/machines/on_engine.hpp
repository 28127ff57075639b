#pragma once

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "tests/support/machines/device_batch.hpp"

namespace stiction::test {

/// Hashes of the answers of the GPU's engine on an emulated device, by these rules.
template <class Real>
std::vector<std::uint64_t> on_engine(cuda::EmulatedDevice& device, const ContactBatch<Real>& batch,
                                     const SolverOptions& options, const cuda::ClassRules& rules = {}) {
  const Capacity need = Capacity::of(batch.view());
  cuda::Engine engine(device, rules);
  engine.reserve(need, options.solver, need.precision);
  const cuda::Stream stream(device);
  DeviceBatch<Real> there(device, need);
  there.fill(batch, stream.get());
  engine.solve(SolveRequest<Real>{nullptr, there.view(), there.solution(), nullptr, options.law.value_or(batch.law()),
                                  options, StreamRef(stream.get())});
  return env_hashes(batch, there.fetch(batch, stream.get()));
}

}  // namespace stiction::test
