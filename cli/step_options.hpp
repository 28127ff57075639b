#pragma once

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "cli/whole_number.hpp"

namespace stiction::cli {

/// The options of `step` that one process and the ranks of a job have in common. In a header, so that CLI11 is compiled
/// where a program's other options are.
inline void declare_steps(CLI::App& app, StepArguments& a) {
  app.add_option("scene", a.scene, "Scene; stiction step --list shows them");
  app.add_option("--size", a.size, "Bodies of an environment of pile or stack [12, 5]")->check(whole_number(1));
  app.add_option("--envs", a.environments, "Environments")->check(whole_number())->capture_default_str();
  app.add_option("--steps", a.steps, "Steps")->check(whole_number())->capture_default_str();
  app.add_option("--seed", a.seed, "Seed; where an environment begins depends on scene, seed and its index alone")
      ->check(whole_number());
  app.add_option("--dt", a.dt, "Length of a step in seconds [the scene's]");
  app.add_option("--precision", a.precision, "f32 or f64")->capture_default_str();
  app.add_option("--law", a.law, "Of contacts: coulomb, convex or boxed")->capture_default_str();
  app.add_option("--blocks", a.blocks, "Of sweeps: contacts that are visited together: cones or pairs")
      ->capture_default_str();
  app.add_option("--iterations", a.iterations, "Sweeps, or Newton steps, of a step at most")->capture_default_str();
  app.add_option("--tolerance", a.tolerance, "On the relative residual; 0: run all iterations")->capture_default_str();
  app.add_option("--warm-start", a.warm_start, "Share of the last impulses to start from")->capture_default_str();
  app.add_option("-o,--output", a.output, "CSV of states to write; - is standard output");
  app.add_option("--every", a.every, "Write states of every so many steps; 0: of the last")
      ->check(whole_number())
      ->capture_default_str();
  app.add_option("--checkpoint", a.checkpoint, "File that the run goes on from where it is there, and is written to");
  app.add_option("--checkpoint-every", a.checkpoint_every, "Write it after every so many steps, and after the last")
      ->check(whole_number(1))
      ->capture_default_str();
  app.add_option("--json", a.json, "JSON report to write; - is standard output");
  app.add_flag("--quiet", a.quiet, "No progress, no summary");
}

}  // namespace stiction::cli
