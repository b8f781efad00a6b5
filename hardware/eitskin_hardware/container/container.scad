// The container of a skin, its drilling jig, and a post with nuts and washers, in mm.
// `eitskin hardware container SKIN.toml -o FOLDER` writes parameters.scad beside this file.
// Electrode 0 has a notch in the rim. part: "dish", "jig", "post" or "all" (dish with posts).
include <parameters.scad>
part = "dish";

module inside(grow) { offset(r = grow, $fn = 48) polygon(outline_mm); }

module at_each_electrode() {
    for (hole = holes_mm)
        translate([hole[0], hole[1], hole_height_mm]) rotate([0, 90, hole[2]]) children();
}

module dish() {
    difference() {
        union() {
            linear_extrude(floor_mm) inside(wall_mm);
            linear_extrude(height_mm) difference() { inside(wall_mm); inside(0); }
        }
        at_each_electrode() translate([0, 0, -wall_mm]) cylinder(d = hole_mm, h = 3 * wall_mm, $fn = 20);
        translate([holes_mm[0][0], holes_mm[0][1], height_mm]) rotate(holes_mm[0][2])
            cube([3 * wall_mm, 2, 2], center = true);
    }
}

// A ring that stands around a bought dish of the same outside, with a guide for each hole.
module jig() {
    difference() {
        linear_extrude(hole_height_mm + 8)
            difference() { inside(wall_mm + clearance_mm + jig_mm); inside(wall_mm + clearance_mm); }
        at_each_electrode() cylinder(d = hole_mm, h = 4 * (wall_mm + jig_mm), $fn = 20);
        translate([holes_mm[0][0], holes_mm[0][1], hole_height_mm + 8]) rotate(holes_mm[0][2])
            cube([6 * (wall_mm + jig_mm), 2, 2], center = true);
    }
}

// From inside to outside: head, washer, wall, washer, nut, solder lug, nut.
module post() {
    color("silver") {
        translate([0, 0, -post_inside_mm]) cylinder(d = hole_mm - 0.1, h = post_mm, $fn = 20);
        translate([0, 0, -1]) cylinder(d = washer_mm, h = 1, $fn = 24);
        translate([0, 0, -4.2]) cylinder(d = nut_mm, h = 3.2, $fn = 6);
        translate([0, 0, wall_mm]) cylinder(d = washer_mm, h = 1, $fn = 24);
        translate([0, 0, wall_mm + 1]) cylinder(d = nut_mm, h = 3.2, $fn = 6);
        translate([0, 0, wall_mm + 5.2]) cylinder(d = nut_mm, h = 3.2, $fn = 6);
    }
}

if (part == "dish") dish();
if (part == "jig") jig();
if (part == "post") post();
if (part == "all") { dish(); at_each_electrode() post(); }
