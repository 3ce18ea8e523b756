// The explorer as a page: its messages go over a WebSocket. In a notebook the notebook's own connection takes its place.
import explorer from "./explore.js";

const address = new URL("live", location.href);
address.protocol = "ws:";
const socket = new WebSocket(address);
socket.binaryType = "arraybuffer";
const listeners = [];
const tell = (header, buffers) => listeners.forEach(each => each(header, buffers));
const model = {
  send: message => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message)),
  on: (event, listener) => event === "msg:custom" && listeners.push(listener),
};
socket.onmessage = ({ data }) => {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let start = 4 + length;
  const buffers = header.lengths.map(size => new DataView(data, (start += size) - size, size));
  tell(header, buffers);
};
socket.onopen = () => explorer.render({ model, el: document.getElementById("explore") });
socket.onclose = () => {
  if (listeners.length) tell({ kind: "ended" }, []);
  else document.getElementById("explore").textContent = "The program does not answer; is rodcone explore still running?";
};
