import jax,time,numpy as np
jax.config.update("jax_enable_x64",True)
from jaxidl.learning.iterate import learn
from jaxidl.paper.study import Condition,PaperStudy,draw_noise
s=PaperStudy(); c=Condition(0,5e-4,5.,5.)
set_=s.setting("pid",c); z=draw_noise(1,6,s.steps); k=jax.random.key(1); f={}
for src in ("joint","weighted"):
    f[src]=jax.jit(lambda a,b,d,src=src: learn(a,b,d,source=src,error_model=s.error_model,training=s.training)[0])
    jax.block_until_ready(f[src](set_,z,k))
t={n:[] for n in f}
for r in range(3):
    for n in f:
        b=time.process_time(); jax.block_until_ready(f[n](set_,z,k)); t[n].append(time.process_time()-b)
print(t, np.median(t["weighted"])/np.median(t["joint"]))
