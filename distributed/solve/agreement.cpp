#include "distributed/solve/agreement.hpp"

#include <string>
#include <vector>

#include "core/job/body_job.hpp"

namespace stiction::distributed {

void add_options(Digest& digest, const TimeStepping& stepping, const BodySolverOptions& options) {
  const double numbers[] = {
      stepping.dt,   stepping.erp,     stepping.slop, stepping.cfm, stepping.restitution_threshold,
      options.omega, options.tolerance};
  digest.add(numbers, 7);
  const Index integers[] = {static_cast<Index>(contact_law(options)), options.iterations, options.substeps,
                            options.momentum ? 1 : 0, kNumericsEpoch};
  digest.add(integers, 5);
}

void require_agreement(Transport& transport, std::uint64_t digest, const char* what) {
  const std::vector<std::uint64_t> all = gather(transport, digest);
  for (std::size_t rank = 1; rank < all.size(); ++rank)
    if (all[rank] != all[0])
      throw Error(ErrorCode::invalid_argument,
                  "rank " + std::to_string(rank) + " has " + what + " than rank 0: give all ranks the same");
}

void require_impulses(const BodySolverOptions& options) {
  if (options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported, "method: ranks solve by BodyMethod::impulses alone; choose it, or one process");
  if (options.max_contacts_per_env != 0)
    throw Error(ErrorCode::unsupported, "max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) +
                                            ": ranks solve all contacts; use 0");
}

}  // namespace stiction::distributed
