// ODE's steppers on the scenes of engine_run.hpp.
//
//     c++ -O2 ode_solve.cpp $(pkg-config --cflags --libs ode)
//
// SOLVER: step is dWorldStep (a matrix, and Dantzig's method), quick is dWorldQuickStep (sweeps over the Jacobian,
// ITERATIONS of them). Both form, solve and move the bodies in one call, which is what is timed; forming is 0.
// Contacts lie at depth 0 without softness and bounce, both friction directions as given, bounds mu times the normal
// force. The world's cfm is ODE's default. Reactions are the joints' forces times the step.

#include <ode/ode.h>

#include "engine_run.hpp"

namespace {

using engines::Call;
using engines::Scene;

constexpr double kStep = 0.005;  // [s]

void set(dReal* to, const double* from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

double dot(const dReal* force, const double* axis) {
  return force[0] * axis[0] + force[1] * axis[1] + force[2] * axis[2];
}

/// ODE's normals point into the first body, so b comes first.
Call solve(const Scene& scene, bool quick, int iterations, dWorldID memory) {
  const dWorldID world = dWorldCreate();
  dWorldUseSharedWorkingMemory(world, memory);
  const dJointGroupID group = dJointGroupCreate(0);
  dWorldSetQuickStepNumIterations(world, iterations);
  dRandSetSeed(1);
  std::vector<dBodyID> bodies;
  for (const engines::Body& body : scene.bodies) {
    const dBodyID one = dBodyCreate(world);
    dMass mass;
    const double* I = body.inertia;
    dMassSetParameters(&mass, body.mass, 0, 0, 0, I[0], I[4], I[8], I[1], I[2], I[5]);
    dBodySetMass(one, &mass);
    dBodySetGyroscopicMode(one, 0);
    dBodySetPosition(one, body.position[0], body.position[1], body.position[2]);
    dBodySetLinearVel(one, body.twist[0], body.twist[1], body.twist[2]);
    dBodySetAngularVel(one, body.twist[3], body.twist[4], body.twist[5]);
    bodies.push_back(one);
  }
  std::vector<dJointFeedback> feedback(scene.contacts.size());
  for (std::size_t k = 0; k < scene.contacts.size(); ++k) {
    const engines::Contact& given = scene.contacts[k];
    dContact contact = {};
    contact.surface.mode = dContactApprox1 | dContactFDir1;
    contact.surface.mu = given.mu;
    set(contact.geom.pos, given.point);
    set(contact.geom.normal, given.normal);
    set(contact.fdir1, given.t1);
    const dJointID joint = dJointCreateContact(world, group, &contact);
    dJointAttach(joint, bodies[static_cast<std::size_t>(given.b)],
                 given.a < 0 ? nullptr : bodies[static_cast<std::size_t>(given.a)]);
    dJointSetFeedback(joint, &feedback[k]);
  }
  Call call;
  const engines::Stopwatch stepping;
  call.claimed = (quick ? dWorldQuickStep : dWorldStep)(world, kStep) != 0;
  call.solve = stepping.seconds();
  for (std::size_t k = 0; k < scene.contacts.size(); ++k)
    for (const double* axis : {scene.contacts[k].normal, scene.contacts[k].t1, scene.contacts[k].t2})
      call.reaction.push_back(dot(feedback[k].f1, axis) * kStep);
  dJointGroupDestroy(group);
  dWorldDestroy(world);
  return call;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6) engines::fail("usage: ode_solve SOLVER ITERATIONS SECONDS IN OUT");
  const std::string name = words[1];
  if (name != "step" && name != "quick") engines::fail("no such solver");
  const int iterations = engines::number<int>(words[2]);
  dInitODE2(0);
  const dWorldID memory = dWorldCreate();  // its buffers serve all the others: none is allocated in a timed call
  const int result = engines::serve<Scene>(
      words, [&](const Scene& scene) { return solve(scene, name == "quick", iterations, memory); });
  dWorldDestroy(memory);
  dCloseODE();
  return result;
}
