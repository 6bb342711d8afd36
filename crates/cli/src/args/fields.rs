//! What the printed fields mean, for the help of the commands.

/// What "monro simulate --json" and its files say of how far the result can be relied on.
pub(super) const SIMULATE_FIELDS: &str = "\
In --json and summary.json:
  reliable        false where the end is not a result: elements turned inside out, or walls through each other, at the
                  end (on the way: a remark), frames held, a target more than 20 mm off, drained volume missed by more
                  than 10 %, more than 0.5 % of the brain crushed, more than 10 % of the ventricles empty (crushed)
  reached_ventricle
                  whether the tip was in a ventricle at any time: CSF came
  csf             when it first was: time_s, depth_mm under the skin, structure; null where it never was
  ends_in_ventricle, at_tip
                  whether it is in one at the end, and what the tip lies in then; a tip that left it again is a remark
  tip_error_mm    at the end, from the tip to the target's tissue, where that is now; tip_error_rigid_mm: to the planned
                  point, as if nothing had moved
  target_shift_mm how far the target's tissue has moved at the end; max_target_shift_mm: at most on the way
  cortex_shift_mm, gap_ml
                  how far the outer surface of the tissue has moved at the end, where most, and what it has left under the
                  skull: with --skull slides; else the surface moves in the burr hole only
  wall_shift_mm   how far the wall of the ventricles has moved at the end, where most; max_wall_shift_mm: on the way, mostly
                  just before it gives way
  withdrawal      of drawing it out (--withdraw): reliable, max_pull_mn (the largest force that lasts with which tissue
                  held it back), left_ventricle_depth_mm (where CSF stopped), left_brain_depth_mm, and, when it was out and
                  the tissue had come to rest, target_shift_mm, wall_shift_mm, at_tip (null: outside) and counts as those
                  of the insertion. All else is of the end of the rest at the target. null where it stayed
  beside          other catheters (--beside): their paths, and at_tip, what the tip of each lay in at the end
  remarks         why, and whatever else is to be said; also on stderr and at the head of report.html
  inverted_most, inverted_at_end
                  turned elements: most in a frame, and in the last one
  case_remarks    what \"monro prepare\" remarked on the case: they bear on its plan and its tissue
  self_crossing   where the surface of the tissue, or a wall between its structures, passes through itself at the end and
                  does not at rest: pairs of triangles that cross, and the place of the first (at_lps_mm); null where it
                  does not. Looked for in the meshes that are written (frames/)
  rollbacks, frames_held
                  steps taken back and done in smaller ones; frames that even the smallest could not solve
  drained_ml      asked and reached; null without --drain-ml
  crushed         at the end: elements of brain and of ventricles that have less than half or more than twice of their
                  volume at rest (count, share of the structure, the worst: volume_ratio, at_lps_mm), and the share of the
                  ventricles in elements that have lost nine tenths (ventricles_empty_share: walls meet)
  csf_pressure_change_mmhg, csf_volume_change_ml
                  of the ventricles at the end, against rest: what came of all that was done; csf_pressure_mmhg is what was
                  asked for
  ms_per_frame    median and p99 of collision, deformation and the surfaces
  outputs         where the files are (--json only)
  max_axial_force_mn
                  of the middle one of three frames in a row: single frames may be of a jump of the tissue
  volumes         of the brain (with the CSF around it, which is simulated as brain: more than labels and report of the
                  case say) and of each ventricle, ml: rest_ml, change_ml at the end, largest_change_ml
  mode, speed_mm_s, diameter_mm, tip_cone_deg (null: round), gravity_m_s2, csf_pressure_mmhg, skull, septa (falx and
  tentorium part the brain), iterations, predicted_space, materials, materials_file, case, plan
                  what was asked; what is not as usual stands also on stdout and at the head of report.html
  max_whole_volume_change_percent
                  of brain and ventricles together, which the skull holds (not with --skull slides): hardly anything, whatever
                  moves inside
In insertion.csv time_s is negative while pressure, drainage and gravity come on and other catheters go in, and the
axial force is empty in a frame held (held is 1): nothing was felt there; it is negative where tissue holds the catheter
back. A result that is not reliable is no failure of the command: the status is 0.";

/// What "monro solve --json" prints.
pub(super) const SOLVE_FIELDS: &str = "\
What is printed (forces in N, along the axes of the scene):
  reactions_N     force of each set on the tissue, in the components that the set holds (0 in the others; what two
                  sets hold counts in both), summed up on the mesh that was solved
  reactions_held  these components
  moments         what the same forces of each set turn: Nm (N m, along the axes of the scene) about about_m, the mean of
                  the vertices that the set holds, where they end up
  rod_moments     the same of each rod; null of one that holds no vertex
  punch_forces_N, rod_forces_N
                  force of each sphere, of each rod on the tissue; punch_force_N, rod_force_N: of the first, along its
                  motion, positive when the tissue resists; null where it stands still
  converged       the tolerance (residual 1e-6) was met with all motion and load imposed, no element is turned, no sphere
                  has gone through the surface, the body does not pass through itself, the loads are borne, and the mesh
                  is as fine as --refine asked
  residual        force out of balance over supports' forces and loads
  unborne         sum of the forces out of balance over the sum of the loads and of the spheres' forces; above 0.01 is no
                  answer
  share           share of the imposed motion and load that was reached, 0 to 1
  tets_solved     elements that the answer was found on, after refinement
  mesh_converged  whether the last refinement changed displacement (at its rate to eight times as many elements) and
                  forces and moments by 5 % at most, and the body stays as found: look at this, too, since what is converged
                  is so on the mesh it was found on; null where there was no refinement, or where it ended before it was known
                  whether the body stays
  mesh_change     what the last refinement changed: the displacement (relative L2, at the nodes given) and the largest force
                  and moment, as shares, the elements before it (tets_before), and the displacement's change at that rate
                  for eight times as many elements (displacement_eightfold), which a finer mesh would still change about; of
                  forces largest is that over the largest force, or a tenth of what balances itself: of the set whose force
                  changed by the largest share of its own, the set and that share at the same rate, in this refinement or in
                  those before as such changes fall (set_force_eightfold; null where nothing was held or none bears a
                  ten-thousandth); null where there was no refinement
  finer_given_up  a finer mesh that was tried after it and given up: its elements (tets) and why; null where none was
  turned          how many of them are turned inside out or without volume
  self_crossing   where the surface of the body, or a wall between its regions, passes through itself and does not at rest:
                  pairs of triangles that cross, and the place of the first in metres (at_m); null where it does not
  newton_steps, products
                  work done on that mesh: Newton steps, products of the tangent stiffness with a vector
  max_displacement_mm, seconds, case, mesh, mode, out, remarks
Paper mode has no forces: frames (stepped), residual_mm (largest motion in the last one), note.";
