#include "distributed/newton/domain_space.hpp"

#include <algorithm>

#include "core/base/extents.hpp"

namespace stiction::distributed {

namespace {

/// Operations of a Newton step on the rows that a rank has.
struct RowsOf {
  const BlockMatrix& matrix;
  const Reach& reach;

  template <Team TeamT>
  void apply(TeamT&, const double* x, double* y) const {
    part_kernels().multiply(matrix.pattern, matrix.values, reach.rows, x, y);
  }
};

/// A preconditioner that has been prepared, as solvers take it.
struct Prepared {
  Schwarz& schwarz;
  template <Team TeamT>
  void apply(TeamT& team, const double* r, double* z) const {
    schwarz.apply(team, r, z);
  }
};

/// Room whose pages are not touched before they are used: matrices are those of the whole environment.
std::unique_ptr<double[]> room_for(const NewtonStream& stream, Offset contacts) {
  return std::make_unique_for_overwrite<double[]>(
      at(SpaceWorkspace::doubles(contacts, stream.pattern.rows, stream.pattern.blocks())));
}

}  // namespace

template <class Real>
DomainSpace::DomainSpace(Transport& transport, const BodyEnv<Real>& env, const SiParams& params, Law law,
                         const Domains& domains, const Reach& reach, std::span<const int> home,
                         std::span<const Point> points, Ordering ordering)
    : domains_(domains),
      reach_(reach),
      team_(transport, domains, reach, home),
      compliance_(compliance_of(params)),
      memory_(room_for(take_newton_stream(env.newton_stream), env.kept)),
      workspace_(law, env.kept, env.bodies, env.newton_stream, memory_.get()),
      is_row_(at(env.bodies), 0),
      schwarz_(transport, workspace_.stream.pattern, domains, reach, points, ordering) {
  for (const Index row : reach.rows) is_row_[at(row)] = 1;
  const Offset numbers = static_cast<Offset>(env.bodies) * kBodyBlock;
  for (double* const vector : {workspace_.point, workspace_.step, workspace_.descent, workspace_.force})
    std::fill_n(vector, numbers, 0.0);
  std::fill_n(workspace_.gradients, numbers * SpaceWorkspace::kVectors, 0.0);
  SerialTeam alone;
  load_space_bodies(alone, env, workspace_);
  load_space_contacts(alone, env, params, workspace_);
  std::vector<double> free(at(numbers));
  for (Index body = 0; body < env.bodies; ++body) {
    double change[kBodyBlock];
    free_twist_of(env, body, change, free.data() + static_cast<Offset>(body) * kBodyBlock);
  }
  for (Index p = 0; p < env.kept; ++p) {
    load_free_motion(env, params, p, free.data(), workspace_.contact[p]);
    largest_mean_ = max_(workspace_.contact[p].mean, largest_mean_);
  }
}

double DomainSpace::least_weight() const {
  return compliance_ >= kEnoughCompliance * largest_mean_ ? 0.0 : kProxWeightLeast;
}

void DomainSpace::set_weight(double weight) {
  for_contacts([&](SpaceContact& contact) { contact.prox_weight = weight * contact.mean; });
}

template <class Real>
void DomainSpace::start(const BodyEnv<Real>& env, const Real* impulse, NewtonSequence& sequence) {
  // Impulses are those of all contacts here: bodies that are seen are pushed by contacts that the reach does not have.
  for (Index p = 0; p < env.kept; ++p)
    for (Index k = 0; k < 3; ++k)
      workspace_.contact[p].prox_center[k] = static_cast<double>(impulse[3 * Offset{env.contact_order[p]} + k]);
  for (const Index body : reach_.seen) start_body(workspace_, body);
  // Enough compliance takes the proximal term's place from the first step on. With a weight that falls each problem
  // finds opening contacts anew: up to twice the steps (docs/math/domain_newton.md).
  sequence.start(sequence.least_weight > 0.0 ? kProxWeightStart : 0.0);
  set_weight(sequence.prox_weight);
  for_contacts([&](SpaceContact& contact) { start_contact(workspace_, contact, compliance_); });
}

double DomainSpace::renew_reactions() {
  for_contacts([&](SpaceContact& contact) { answer_motion(contact, workspace_.law, compliance_); });
  for (const Index row : reach_.rows) renew_descent_of(workspace_, row);
  double largest = 0.0;
  for (const int domain : reach_.domains)
    for (const Index p : domains_.contacts[at(domain)])
      largest = larger_motion(workspace_.contact[p], workspace_.descent, largest);
  return team_.max(largest);
}

void DomainSpace::assemble_curvature() {
  for_contacts([&](SpaceContact& contact) { turn_curvature(contact, compliance_); });
  const BlockPattern& pattern = workspace_.stream.pattern;
  // A block above the diagonal has its transpose below, in a row that the rank may not have.
  for (const Index row : reach_.rows)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k) {
      const Index column = pattern.columns[k];
      if (column <= row) assemble_lower_block(workspace_, row, k);
      if (column > row && is_row_[at(column)] == 0)
        assemble_lower_block(workspace_, column, workspace_.stream.mirror[k]);
    }
  for (const Index row : reach_.rows)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k)
      if (pattern.columns[k] > row)
        mirror_block(workspace_.H.block(workspace_.stream.mirror[k]), workspace_.H.block(k));
}

void DomainSpace::solve_linear(SpaceSystem system, double tolerance) {
  schwarz_.prepare(workspace_.H);
  const KrylovProblem problem{workspace_.H.unknowns(), workspace_.force, workspace_.step,
                              workspace_.gradients,    tolerance,        kMostGradientSteps};
  const Prepared prepared{schwarz_};
  const GradientOutcome outcome = system == SpaceSystem::symmetric
                                      ? conjugate_gradient(team_, RowsOf{workspace_.H, reach_}, problem, prepared)
                                      : bicgstab(team_, RowsOf{workspace_.sliding, reach_}, problem, prepared);
  linear_steps_ += outcome.iterations;
}

bool DomainSpace::take_step(NewtonSequence& sequence) {
  const double energy = dot_product(team_, workspace_.H.unknowns(), workspace_.descent, workspace_.force);
  assemble_curvature();
  solve_linear(SpaceSystem::symmetric, sequence.step_tolerance(energy));
  for_contacts([&](SpaceContact& contact) { relative_motion(contact, workspace_.step, contact.along); });
  // Sums over a subdomain: f'd, d'Md, the contacts' part of the slope at 0, and the magnitudes it is made of.
  const auto begin = team_.sum<4>([&](int domain, std::array<double, 4>& sum) {
    sum[0] = dot_of_domain(team_, domain, workspace_.force, workspace_.step);
    for (const Index row : domains_.bodies[at(domain)]) sum[1] = sum[1] + curvature_of_body(workspace_, row);
    for (const Index p : domains_.contacts[at(domain)]) {
      sum[2] = sum[2] + look_along(workspace_.contact[p], compliance_, 0.0).slope;
      sum[3] = slope_terms(workspace_.contact[p], compliance_, sum[3]);
    }
  });
  const double slope = 0.0 - begin[0], noise = 0x1p-50 * begin[3];
  const LinePoint bodies{slope - begin[2], begin[1]};
  const bool falls = slope < 0.0 - noise;
  const auto look = [&](double alpha) {
    const auto contacts = team_.sum<2>([&](int domain, std::array<double, 2>& sum) {
      for (const Index p : domains_.contacts[at(domain)]) {
        const LinePoint part_of = look_along(workspace_.contact[p], compliance_, alpha);
        sum[0] = sum[0] + part_of.slope;
        sum[1] = sum[1] + part_of.curvature;
      }
    });
    return at_place(bodies, {contacts[0], contacts[1]}, alpha);
  };
  const double alpha = falls ? search_line(look, slope, kSpaceSlopeLeft, noise) : 1.0;
  for_numbers([&](Offset i) { workspace_.point[i] = follow_line(workspace_.point[i], workspace_.step[i], alpha); });
  for_contacts([&](SpaceContact& contact) { follow_line(contact, alpha); });
  return falls;
}

void DomainSpace::renew_problem(NewtonSequence& sequence) {
  const bool with_sliding = workspace_.law == Law::coulomb;
  for_contacts([](SpaceContact& contact) { std::copy_n(contact.reaction, 3, contact.prox_center); });
  sequence.fall();
  set_weight(sequence.prox_weight);
  assemble_curvature();
  for_contacts([&](SpaceContact& contact) { prepare_renewal(contact, compliance_, with_sliding); });
  for (const Index row : reach_.rows) renew_descent_of(workspace_, row);
  if (with_sliding)
    for (const Index row : reach_.rows)
      for (Index k = workspace_.stream.pattern.offsets[row]; k < workspace_.stream.pattern.offsets[row + 1]; ++k)
        assemble_block(workspace_, row, k, workspace_.sliding.block(k));
  solve_linear(with_sliding ? SpaceSystem::sliding : SpaceSystem::symmetric, kRenewalTolerance);
  for_contacts([&](SpaceContact& contact) { finish_renewal(workspace_, contact, compliance_, with_sliding); });
  for_numbers([&](Offset i) { workspace_.point[i] = workspace_.point[i] + workspace_.step[i]; });
}

template DomainSpace::DomainSpace(Transport&, const BodyEnv<float>&, const SiParams&, Law, const Domains&, const Reach&,
                                  std::span<const int>, std::span<const Point>, Ordering);
template DomainSpace::DomainSpace(Transport&, const BodyEnv<double>&, const SiParams&, Law, const Domains&,
                                  const Reach&, std::span<const int>, std::span<const Point>, Ordering);
template void DomainSpace::start(const BodyEnv<float>&, const float*, NewtonSequence&);
template void DomainSpace::start(const BodyEnv<double>&, const double*, NewtonSequence&);

}  // namespace stiction::distributed
