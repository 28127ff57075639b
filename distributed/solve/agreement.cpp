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
  if (options.blocks != BlockMode::cones) digest.add(static_cast<std::uint64_t>(options.blocks));
}

template <class Real>
std::uint64_t digest_of(const BodyBatchView<Real>& batch, std::span<const int> owner, const TimeStepping& stepping,
                        const BodySolverOptions& options, const Real* warm_start) {
  Digest digest;
  digest.add(batch.env_body_offsets, batch.env_count + 1);
  digest.add(batch.env_contact_offsets, batch.env_count + 1);
  digest.add(batch.kinematic, batch.body_count);
  digest.add(batch.inv_mass, batch.body_count);
  for (const Real* rows : {batch.inv_inertia, batch.twist, batch.twist_change}) digest.add(rows, 6 * batch.body_count);
  for (const Index* rows : {batch.body_a, batch.body_b}) digest.add(rows, batch.contact_count);
  for (const Real* rows : {batch.arm_a, batch.arm_b, batch.normal, warm_start})
    digest.add(rows, 3 * batch.contact_count);
  for (const Real* rows : {batch.mu, batch.depth, batch.restitution}) digest.add(rows, batch.contact_count);
  digest.add(owner.data(), batch.body_count);
  add_options(digest, stepping, options);
  return digest.sum();
}

void require_agreement(Transport& transport, std::uint64_t digest, const char* what) {
  const std::vector<std::uint64_t> all = gather(transport, digest);
  for (std::size_t rank = 1; rank < all.size(); ++rank)
    if (all[rank] != all[0])
      throw Error(ErrorCode::invalid_argument,
                  "rank " + std::to_string(rank) + " has " + what + " than rank 0: give all ranks the same");
}

void require_owners(const char* name, const char* what, std::span<const int> owner, Offset bodies, int count) {
  if (owner.size() != static_cast<std::size_t>(bodies))
    throw Error(ErrorCode::invalid_argument, std::string(name) + " has " + std::to_string(owner.size()) +
                                                 " elements, expected " + std::to_string(bodies) +
                                                 ", one for each body");
  for (std::size_t body = 0; body < owner.size(); ++body)
    if (owner[body] < 0 || owner[body] >= count)
      throw Error(ErrorCode::invalid_argument, std::string(name) + "[" + std::to_string(body) +
                                                   "] = " + std::to_string(owner[body]) + ": expected a " + what +
                                                   " in 0.." + std::to_string(count - 1));
}

void require_impulses(const BodySolverOptions& options) {
  if (options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported, "method: ranks solve by BodyMethod::impulses alone; choose it, or one process");
  if (options.max_contacts_per_env != 0)
    throw Error(ErrorCode::unsupported, "max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) +
                                            ": ranks solve all contacts; use 0");
}

template std::uint64_t digest_of(const BodyBatchView<float>&, std::span<const int>, const TimeStepping&,
                                 const BodySolverOptions&, const float*);
template std::uint64_t digest_of(const BodyBatchView<double>&, std::span<const int>, const TimeStepping&,
                                 const BodySolverOptions&, const double*);

}  // namespace stiction::distributed
