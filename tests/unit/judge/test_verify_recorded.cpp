#include <gtest/gtest.h>

#include <vector>

#include "stiction/residual.hpp"

namespace {

using namespace stiction;

template <class Real>
Residual residual_of(const Environment<Real>& environment, Law law, const std::vector<Real>& lambda) {
  ContactBatch<Real> batch(law);
  batch.add(environment);
  return verify(batch.view(), std::span<const Real>(lambda)).at(0);
}

// Every kind of cone in one unsymmetric system of 13 rows; axis 3 of the second friction cone has no friction. The
// expected numbers are those of the independent checker (Python, numpy) that judges solutions of contact batches.
TEST(Verify, AgreesWithTheIndependentCheckerOnEveryKindOfCone) {
  constexpr Index kRows = 13;
  Environment<double> environment;
  environment.cones = {{ConeKind::free, 1, -1},     {ConeKind::unilateral, 1, -1}, {ConeKind::box, 1, -1},
                       {ConeKind::friction, 3, -1}, {ConeKind::friction, 6, -1},   {ConeKind::unilateral, 1, -1}};
  std::vector<double> matrix;
  for (Index i = 0; i < kRows; ++i) {
    for (Index j = 0; j < kRows; ++j) matrix.push_back(i == j ? 4.0 : 1.0 / (1 + i + 2 * j));
    environment.b.push_back((i % 2 == 0 ? 1.0 : -1.0) * (0.5 + 0.25 * i));
    environment.R.push_back(0.125 * (i % 3));
  }
  environment.set_dense(matrix, kRows);
  environment.mu = {0, 0, 0, 0, 0.5, 0.25, 0, 0.5, 1.5, 0, 0.125, 0.0625, 0};
  environment.lo.assign(kRows, 0.0);
  environment.hi.assign(kRows, 0.0);
  environment.lo[2] = -0.75;
  environment.hi[2] = 0.75;
  const std::vector<double> lambda{0.5, 0.25, -0.75, 1, 0.25, -0.125, 2, -0.5, 0.5, 0.25, 0.0625, -0.03125, 0};
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 4.24100564261927, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 6.856520619089539, 1e-14);
}

// Environment 0 of the FCLIB-derived file coulomb/small.h5 of the shared data: one sliding contact. Expected: the
// checker's numbers for the stored reference, and for the reference times 1.25.
TEST(Verify, AgreesWithTheIndependentCheckerOnARecordedCoulombContact) {
  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 3, -1}};
  environment.set_dense(std::vector<double>{0.01561729905012577, -1.0655799081608867e-14, 1.7158644344052322e-15,
                                            7.981228895182632e-15, 0.015617299050235248, 9.116734914056958e-15,
                                            -5.230882430029561e-15, 6.346284194006859e-15, 0.015617299050090447},
                        3);
  environment.b = {-0.00027270065311702494, 0.0001125771176745515, 6.823759394344223e-05};
  environment.mu = {0, 0.3, 0.3};
  std::vector<double> lambda{0.017461447862509104, -0.0044797382874196745, -0.002715352538288052};
  EXPECT_LT(residual_of(environment, Law::coulomb, lambda).relative, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.047886788572866185, 1e-14);
  for (double& value : lambda) value *= 1.25;
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 0.2500000000000103, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.19014151428391737, 1e-14);
}

// Environment 1 of mujoco/car.h5 of the shared data: a joint limit and two contacts, A unsymmetric in the last bits.
TEST(Verify, AgreesWithTheIndependentCheckerOnARecordedCar) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}, {ConeKind::friction, 3, -1}, {ConeKind::friction, 3, -1}};
  environment.set_dense(
      std::vector<double>{11.516565514066901,  -1.4335996222020284,   -0.012235375821121157, -0.05038171276194473,
                          -1.4311403588040361, -0.012511863830869791, -0.040332110713026906, -1.4335996222020277,
                          9.485152981971387,   3.0180684719584776,    -0.1927772337736745,   7.608777908615247,
                          3.0074323092484625,  -0.11191013699189983,  -0.012235375821121167, 3.0180684719584767,
                          4.070970851372634,   -2.4808867483793917,   2.1530688337883457,    4.054464663292302,
                          -2.0378789687362837, -0.05038171276194487,  -0.1927772337736743,   -2.4808867483793917,
                          38.591630833536456,  -0.13256830395189007,  -2.4633566606921513,   37.9879843873724,
                          -1.4311403588040366, 7.608777908615245,     2.153068833788346,     -0.13256830395189012,
                          6.270683916773335,   2.1455120394213316,    -0.07588383957613873,  -0.0125118638308698,
                          3.007432309248461,   4.054464663292303,     -2.4633566606921518,   2.145512039421332,
                          4.0381434043593085,  -2.026337759623532,    -0.040332110713027156, -0.11191013699189971,
                          -2.0378789687362837, 37.98798438737241,     -0.07588383957613877,  -2.026337759623532,
                          37.59000378721918},
      7);
  environment.b = {0.04624634877153255, -23.20107120900994,  -4.170574243933389, 140.1496999993192,
                   -21.914932125777597, -4.2179565939993635, 141.93148757911877};
  environment.R = {0.16560347350599158, 0.25503731491513776, 0.25503731491513776, 0.25503731491513776,
                   0.2952095590529801,  0.2952095590529801,  0.2952095590529801};
  environment.mu = {0, 0, 1, 1, 0, 1, 1};
  std::vector<double> lambda{0.560488261646353, 0, 0, 0, 4.739809307314852, -2.7947336000305216, -3.828218433497354};
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 4.1412010555092526e-11, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 0.11630406256781167, 1e-14);
  for (double& value : lambda) value *= 1.25;
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.21489839098940572, 1e-13);
}

}  // namespace
