use super::*;

fn checked(text: &str) -> Result<CheckedObj, ObjError> {
    check(text, Smoothing::Groups)
}

#[test]
fn materials_follow_usemtl_whatever_objects_and_groups_say() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red paint\no first\nf 1 2 3\no second\nf 1 2 \
                3\nusemtl a\ng g\nf 1 2 3\n";
    let names: Vec<Option<String>> = checked(text)
        .unwrap()
        .groups
        .into_iter()
        .map(|g| g.material)
        .collect();
    assert_eq!(names, [Some("red paint".to_owned()), Some("a".to_owned())]);
}

#[test]
fn errors_name_their_line() {
    let cases = [
        ("v 0 0\n", 1, "3 coordinates"),
        ("v 0 0 0\nv a 0 0\n", 2, "`a` is not a number"),
        ("v 0 nan 0\n", 1, "not finite"),
        ("v 0 0 0 x\n", 1, "x"),
        ("v 0 0 0\r\nf 1 2 3\r\n", 2, "index 2 is out of range"),
        ("v 0 0 0\nf 0 1 1\n", 2, "index 0"),
        ("v 0 0 0\nf -2 1 1\n", 2, "index -2"),
        ("v 0 0 0\nf 1/1 1/1 1/1\n", 2, "texture coordinate index 1"),
        ("v 0 0 0\nf 1//9 1//9 1//9\n", 2, "normal index 9"),
        ("v 0 0 0\nf 1//// 1 1\n", 2, "more than three"),
        ("v 0 0 0\nf 9223372036854775807 1 1\n", 2, "out of range"),
        ("v 0 0 0\nf -9223372036854775808 1 1\n", 2, "out of range"),
        ("v 0 0 0\nf 1e3 1 1\n", 2, "not an index"),
        ("vn 0 1\n", 1, "found 2"),
    ];
    for (text, line, part) in cases {
        let error = checked(text).unwrap_err();
        assert_eq!(error.line, line, "{text:?}");
        assert!(error.problem.contains(part), "{text:?}: {}", error.problem);
    }
}

#[test]
fn unusual_but_valid_files_are_read() {
    let text = "v 0 0 0\nv 1 0 0 1\nv 0 1 0 1 0 0\nvt 0.5\nf 1/1 \\\n 2/1 3/1\nf -3 -2 -1\nf 4 \
                1 2\nv 1 1 1\n";
    let c = checked(text).unwrap();
    assert!(c.vertices.contains("v 1 0 0 1 1 1\n"), "{}", c.vertices);
    assert!(
        c.faces.contains("f 1/1/ 2/1/ 3/1/\n") && c.faces.contains("f 4// 1// 2//\n"),
        "{}",
        c.faces
    );
    assert_eq!(c.groups.len(), 2);
    assert!(c.notes.is_empty(), "{:?}", c.notes);
}

#[test]
fn ignored_statements_are_noted() {
    let text = "v 0 0 0\nv 2 0 0\nv 0.1 0.1 0\nv 0 2 0\nvn 0 0 0\nvt nan 0\nl 1 2\np 1\nf 1 \
                2\nf 2 3 4 1\nf 1//1 2 3\ncurv 0 1\ncurv 0 1\n";
    let notes = checked(text).unwrap().notes;
    let all: Vec<String> = notes.iter().map(|(p, m)| format!("{p}: {m}")).collect();
    for part in [
        "line 7: line and point elements, which have no surface, are ignored: 2",
        "line 9: faces with fewer than three vertices are left out: 1",
        "line 12: statements `curv`",
        "line 11: normals or texture coordinates of only some",
    ] {
        assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
    }
    for part in [
        "normals without a direction",
        "texture coordinates that are not finite",
    ] {
        assert!(all.iter().any(|n| n.contains(part)), "{part} in {all:?}");
    }
    assert_eq!(all.iter().filter(|n| n.contains("curv")).count(), 1);
}

#[test]
fn a_concave_polygon_is_cut_into_ears_and_noted_only_if_its_edges_intersect() {
    let dart = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\n";
    let faces = |text: &str| {
        let c = checked(&format!("{dart}{text}")).unwrap();
        (c.faces, c.notes.iter().any(|(_, m)| m.contains("concave")))
    };
    let (ears, noted) = faces("f 1 2 3 4\n");
    assert_eq!((ears.matches('f').count(), noted), (2, false), "{ears}");
    // A fan from the inner corner covers exactly the dart.
    assert_eq!(
        faces("f 4 1 2 3\n"),
        ("o 0\nf 4// 1// 2// 3//\n".to_owned(), false)
    );
    let bow = "v 0 0 1\nv 3 0 1\nv 0 1 1\nv 1 1 1\nf -4 -3 -2 -1\n";
    assert!(faces(bow).1);
}

#[test]
fn comments_follow_numbers_and_names_may_contain_their_sign() {
    let text = "v 0 0 0 # origin\nv 1 0 0#x\nv 0 1 0\nvt 0 0 # 1\nvn 0 0 1 # up\n#f 9 9 9\n\
                usemtl Map #1\nf 1/1/1 2/1/1 3/1/1 # front\nf 1 2 3# back\n";
    let c = checked(text).unwrap();
    assert_eq!(c.groups[0].material.as_deref(), Some("Map #1"));
    assert!(c.notes.is_empty(), "{:?}", c.notes);
    assert!(c.faces.contains("f 1/1/1 2/1/1 3/1/1\n") && c.faces.contains("f 1// 2// 3//\n"));
}

#[test]
fn colours_of_vertices_are_decoded_and_others_are_white() {
    let c = checked("v 0 0 0\nv 1 0 0 1 0.5 0 1\nv 0 1 0\nf 1 2 3\n").unwrap();
    let decoded = srgb_to_linear(0.5);
    let expected = format!("v 0 0 0 1 1 1\nv 1 0 0 1 {decoded} 0\nv 0 1 0 1 1 1\n");
    assert_eq!(c.vertices, expected);
    let c = checked("v 0 0 0 255 0 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n").unwrap();
    assert!(c.vertices.starts_with("v 0 0 0 1 0 0\n"), "{}", c.vertices);
    assert!(c.notes[0].1.contains("divided by 255"), "{:?}", c.notes);
    assert!(checked("v 0 0 0 nan 0 0\n").is_err());
}

#[test]
fn faces_of_a_smoothing_group_share_normals() {
    // A roof whose ridge is along y.
    let corners = "v 0 -1 0\nv 0 1 0\nv -1 1 -1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\n";
    let normals = |groups: [&str; 2]| -> Vec<String> {
        let [left, right] = groups;
        let c = checked(&format!("{corners}{left}f 1 2 3 4\n{right}f 1 5 6 2\n")).unwrap();
        let lines = c.vertices.lines().filter(|line| line.starts_with("vn"));
        lines.map(str::to_owned).collect()
    };
    let together = normals(["s 1\n", "g right\n"]);
    assert_eq!(together.len(), 6, "{together:?}");
    let ridge: Vec<f32> = together[0]
        .split(' ')
        .skip(1)
        .map(|x| x.parse().unwrap())
        .collect();
    assert!(
        Vec3::from_slice(&ridge).distance(Vec3::Z) < 1e-6,
        "{ridge:?}"
    );
    assert_eq!(normals(["s 1\n", "s 2\n"]).len(), 8);
    assert_eq!(normals(["s 1\n", "s off\n"]).len(), 4);
    assert!(normals(["", "s 0\n"]).is_empty());
    let own = checked("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 1 0\ns 1\nf 1//1 2//1 3//1\n").unwrap();
    assert!(!own.groups[0].smoothed && own.vertices.matches("vn").count() == 1);
    let text = format!("{corners}s 1\nf 1 2 3 4\n");
    let ignored = check(&text, Smoothing::Ignored).unwrap();
    assert!(!ignored.groups[0].normals, "{:?}", ignored.groups);
}
