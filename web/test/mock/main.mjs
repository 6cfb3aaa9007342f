// The mock server by hand, with robots on the move: `npm run build && npm run mock -- [PORT]`.

import { createMockServer, MOCK_TOKEN } from "./server.mjs";

const STEP_MS = 300;

const mock = createMockServer();
const origin = await mock.listen(Number(process.argv[2] ?? 0));
console.log(`${origin}/#token=${MOCK_TOKEN}`);
setInterval(() => {
  mock.step();
}, STEP_MS);
