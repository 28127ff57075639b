#pragma once

#include "core/machine/articulated_machine.hpp"
#include "cuda/api/device_api.hpp"

namespace stiction::cuda {

/// Robots on a device: a launch for each call. Their arrays stay in its memory. `job` names the host's, from which they
/// begin. `most_bytes`: of lanes' memory, unless a single team needs more. Environments beyond it wait for a lane.
template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_device_articulated_machine(std::shared_ptr<DeviceApi> api,
                                                                          const ArticulatedJob<Real>& job,
                                                                          Offset env_count, Offset most_bytes);

}  // namespace stiction::cuda
