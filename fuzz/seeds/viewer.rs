//! Requests to the viewer's server and messages of its page.

use std::fs;
use std::path::Path;

/// Writes HTTP requests and page messages, after a byte that selects the kind.
pub fn write(folder: &Path) -> std::io::Result<()> {
    let camera =
        r#"{"position":[9,-2,3],"focal_point":[2,1,-1],"view_up":[0,0,1],"view_angle":40}"#;
    let pages = [
        r#"{"type":"camera","seq":1,"camera":CAMERA,"moving":true}
{"type":"ack","frame":1}
{"type":"camera","seq":2,"camera":CAMERA}
{"type":"pick","id":1,"x":20.5,"y":15}
{"type":"profile","id":2,"points":[[0,0,0],[4,2,1]],"width":0.5,"up":[0,0,1]}
{"type":"volume","id":4,"points":[[0,0,0],[4,2,1],[0,3,0]],"up":[0,0,1],"base":"mean","cell_size":0.5}
{"type":"histogram","id":5,"column":"z"}
{"type":"points","id":6,"format":"laz"}"#,
        r##"{"type":"set","seq":1,"scene":{"surface":"disc","color":"elevation","cmap":"viridis","range":[0,2],"radius":"adaptive:6"}}
{"type":"set","seq":2,"scene":{"sun":{"azimuth":120,"elevation":30},"light":["sun","sky"],"exposure":0.5,"background":"#102030"}}
{"type":"set","seq":3,"scene":{"material":"full.ply=glass:ior=1.3","clip_box":"([0,5],[0,3],[-2,2])","clip_plane":[1,1,0,1,0,0]},"moving":true}
{"type":"set","seq":4,"scene":{"surface":null,"material":null,"clip_box":null,"time":0.5,"subsample":"random:5","spp":2}}"##,
        r#"{"type":"size","width":64,"height":32}
{"type":"save","id":1,"width":30,"height":20}
{"type":"cancel","id":1}
{"type":"export","id":2,"width":30,"height":20}
{"type":"loadScene","id":3,"name":"a.toml","text":"spp = 2\n[camera]\nposition = [1, 2, 3]\n[[object]]\nfile = \"full.ply\""}
{"type":"loadScene","id":4,"name":"a.json","text":"{\"surface\": \"sphere\", \"object\": []}"}"#,
        r#"{"type":"set","seq":1,"scene":{"camera":{"orthographic":9,"view_angle":null},"up":[0,1,0],"edge_test":"off"}}
{"type":"set","seq":2,"scene":{"camera":{"panorama":true,"orthographic":null},"environment":"/etc/passwd"}}
{"type":"hello","width":3,"height":2}"#,
        r#"{"type":"ping"}
{"type":"visible","id":1,"points":[[0,0,0],[4,2,1]]}
{"type":"movie","id":2,"format":"gif","width":16,"height":12,"fps":5}
{"type":"addFile","id":3,"name":"b.xyz","n_bytes":12}
{"type":"cancel","id":2}"#,
    ];
    for (i, page) in pages.iter().enumerate() {
        let page = page.replace("CAMERA", camera);
        fs::write(folder.join(format!("page-{i}")), format!("\t{page}"))?;
    }
    let body = r#"{"camera":{"direction":[0,0,-1],"orthographic":true},"resolution":[20,10]}"#;
    let requests = [
        "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_owned(),
        "GET /scene HTTP/1.1\r\nHost: 127.0.0.1:80\r\n\r\nGET /stats HTTP/1.0\r\nHost: localhost\r\n\r\n".into(),
        "GET /render?resolution=20x10&camera-azimuth-angle=30&light=sky HTTP/1.1\r\nHost: [::1]\r\nOrigin: http://[::1]\r\n\r\n".into(),
        format!("POST /render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n{body}", body.len()),
        format!("POST /render HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n{:x}\r\n{body}\r\n0\r\n\r\n", body.len()),
        "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n\u{1}\u{3}abc".into(),
    ];
    for (i, request) in requests.iter().enumerate() {
        fs::write(folder.join(format!("request-{i}")), format!("\n{request}"))?;
    }
    Ok(())
}
