// Bullet's solvers on the problems of engine_run.hpp.
//
//     c++ -O2 bullet_solve.cpp $(pkg-config --cflags --libs bullet-float64)     or bullet, which is single precision
//
// SOLVER:
//
// * dantzig, lemke, pgs on boxed LCPs through btMLCPSolverInterface. lemke leaves bounds and findex out: LCPs only.
//   pgs stops before ITERATIONS when the squares of all changes in a sweep add up to less than 1e-20.
// * si on scenes: btSequentialImpulseConstraintSolver without warm start, split impulses, restitution and
//   randomisation, two directions of friction as given.
//
// Forming is, for the first three, filling Bullet's matrix and vectors; for si, its set-up and finish.

#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/ConstraintSolver/btSequentialImpulseConstraintSolver.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btLemkeSolver.h>
#include <BulletDynamics/MLCPSolvers/btSolveProjectedGaussSeidel.h>

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <memory>

#include "engine_run.hpp"

namespace {

using engines::BoxedLcp;
using engines::Call;
using engines::Scene;
using engines::Stopwatch;

btScalar scalar(double value) {
  return static_cast<btScalar>(std::clamp(value, -double(SIMD_INFINITY), double(SIMD_INFINITY)));
}

/// Bullet's equation is A x = b + w.
Call solve_matrix(btMLCPSolverInterface& solver, const BoxedLcp& p, int iterations) {
  Call call;
  const Stopwatch forming;
  const int n = p.rows();
  btMatrixXu A(n, n);
  btVectorXu b(n), x(n), lo(n), hi(n);
  btAlignedObjectArray<int> findex;
  findex.resize(n);
  x.setZero();
  for (int i = 0; i < n; ++i) {
    const auto row = static_cast<std::size_t>(i);
    for (int j = 0; j < n; ++j)
      A.setElem(i, j, static_cast<btScalar>(p.A[row * static_cast<std::size_t>(n) + static_cast<std::size_t>(j)]));
    b[i] = static_cast<btScalar>(-p.b[row]);
    lo[i] = scalar(p.lo[row]), hi[i] = scalar(p.hi[row]);
    findex[i] = static_cast<int>(p.findex[row]);
  }
  call.form = forming.seconds();
  const Stopwatch solving;
  call.claimed = solver.solveMLCP(A, b, x, lo, hi, findex, iterations);
  call.solve = solving.seconds();
  for (int i = 0; i < n; ++i) call.reaction.push_back(double(x[i]));
  return call;
}

btVector3 vector(const double* v) {
  return {static_cast<btScalar>(v[0]), static_cast<btScalar>(v[1]), static_cast<btScalar>(v[2])};
}

btMatrix3x3 matrix(const double* m) {
  return {static_cast<btScalar>(m[0]), static_cast<btScalar>(m[1]), static_cast<btScalar>(m[2]),
          static_cast<btScalar>(m[3]), static_cast<btScalar>(m[4]), static_cast<btScalar>(m[5]),
          static_cast<btScalar>(m[6]), static_cast<btScalar>(m[7]), static_cast<btScalar>(m[8])};
}

/// The scene as Bullet's objects; normals point from Bullet's second body to its first, so b comes first.
class World {
 public:
  explicit World(const Scene& scene) : fixed_(0, nullptr, nullptr) {
    for (const engines::Body& body : scene.bodies) {
      bodies_.push_back(
          std::make_unique<btRigidBody>(static_cast<btScalar>(body.mass), nullptr, nullptr, vector(body.principal)));
      bodies_.back()->setCenterOfMassTransform(btTransform(matrix(body.axes), vector(body.position)));
      bodies_.back()->setLinearVelocity(vector(body.twist));
      bodies_.back()->setAngularVelocity(vector(body.twist + 3));
      bodies_.back()->updateInertiaTensor();
      objects.push_back(bodies_.back().get());
    }
    for (const engines::Contact& contact : scene.contacts) {
      btRigidBody* a = contact.a < 0 ? &fixed_ : bodies_[static_cast<std::size_t>(contact.a)].get();
      btRigidBody* b = bodies_[static_cast<std::size_t>(contact.b)].get();
      const btVector3 point = vector(contact.point);
      btManifoldPoint local(b->getCenterOfMassTransform().invXform(point),
                            a->getCenterOfMassTransform().invXform(point), vector(contact.normal), 0);
      local.m_positionWorldOnA = local.m_positionWorldOnB = point;
      local.m_combinedFriction = static_cast<btScalar>(contact.mu);
      local.m_lateralFrictionDir1 = vector(contact.t1);
      local.m_lateralFrictionDir2 = vector(contact.t2);
      local.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
      if (manifolds_.empty() || manifolds_.back()->getBody0() != b || manifolds_.back()->getBody1() != a ||
          manifolds_.back()->getNumContacts() == MANIFOLD_CACHE_SIZE) {
        manifolds_.push_back(std::make_unique<btPersistentManifold>(b, a, 0, btScalar(1), btScalar(1)));
        manifolds.push_back(manifolds_.back().get());
      }
      manifolds_.back()->addManifoldPoint(local);
    }
  }

  std::vector<double> reactions() const {
    std::vector<double> all;
    for (const auto& manifold : manifolds_)
      for (int i = 0; i < manifold->getNumContacts(); ++i) {
        const btManifoldPoint& point = manifold->getContactPoint(i);
        all.push_back(double(point.m_appliedImpulse));
        all.push_back(double(point.m_appliedImpulseLateral1));
        all.push_back(double(point.m_appliedImpulseLateral2));
      }
    return all;
  }

  std::vector<btCollisionObject*> objects;
  std::vector<btPersistentManifold*> manifolds;

 private:
  btRigidBody fixed_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<std::unique_ptr<btPersistentManifold>> manifolds_;
};

/// solveGroup() in its three parts, timed apart.
class Impulses : public btSequentialImpulseConstraintSolver {
 public:
  Call solve(const Scene& scene, int iterations) {
    btContactSolverInfo info;
    info.m_numIterations = iterations;
    // With the flag of warm starts, impulses are written back; they start from 0 all the same.
    info.m_solverMode = SOLVER_SIMD | SOLVER_USE_WARMSTARTING | SOLVER_USE_2_FRICTION_DIRECTIONS |
                        SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
    info.m_splitImpulse = false;
    info.m_leastSquaresResidualThreshold = 0;
    World world(scene);
    const int bodies = static_cast<int>(world.objects.size()), manifolds = static_cast<int>(world.manifolds.size());
    btCollisionObject** objects = world.objects.data();
    btPersistentManifold** contacts = world.manifolds.data();
    Call call;
    const Stopwatch setting_up;
    solveGroupCacheFriendlySetup(objects, bodies, contacts, manifolds, nullptr, 0, info, nullptr);
    call.form = setting_up.seconds();
    const Stopwatch iterating;
    solveGroupCacheFriendlyIterations(objects, bodies, contacts, manifolds, nullptr, 0, info, nullptr);
    call.solve = iterating.seconds();
    const Stopwatch finishing;
    solveGroupCacheFriendlyFinish(objects, bodies, info);
    call.form += finishing.seconds();
    call.reaction = world.reactions();
    return call;
  }
};

}  // namespace

int main(int count, char** words) {
  if (count != 6) engines::fail("usage: bullet_solve SOLVER ITERATIONS SECONDS IN OUT");
  const std::string name = words[1];
  const int iterations = engines::number<int>(words[2]);
  if (name == "si") {
    Impulses impulses;
    return engines::serve<Scene>(words, [&](const Scene& scene) { return impulses.solve(scene, iterations); });
  }
  std::unique_ptr<btMLCPSolverInterface> solver;
  if (name == "dantzig") solver = std::make_unique<btDantzigSolver>();
  if (name == "lemke") {
    auto lemke = std::make_unique<btLemkeSolver>();
    lemke->m_useLoHighBounds = false;
    lemke->m_maxLoops = iterations;
    solver = std::move(lemke);
  }
  if (name == "pgs") {
    auto sweeps = std::make_unique<btSolveProjectedGaussSeidel>();
    sweeps->m_leastSquaresResidualThreshold = btScalar(1e-20);
    solver = std::move(sweeps);
  }
  if (!solver) engines::fail("no such solver");
  return engines::serve<BoxedLcp>(words, [&](const BoxedLcp& p) { return solve_matrix(*solver, p, iterations); });
}
